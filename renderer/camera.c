#include "renderer/camera.h"

#include <math.h>

int camera_view_count(const struct scene *scene)
{
	return scene->camera.projection == PROJECTION_CUBEMAP && scene->camera.face == FACE_ALL ? FACE_ALL : 1;
}

struct camera_view camera_view_of(const struct scene *scene, int index)
{
	const int count = camera_view_count(scene), height = scene->output.height / count;
	const bool cube = scene->camera.projection == PROJECTION_CUBEMAP;
	struct scene_camera camera = scene->camera;
	struct camera_view view = {.projection = cube ? PROJECTION_PERSPECTIVE : camera.projection,
				   .width = scene->output.width,
				   .height = height,
				   .first_row = index * height};
	if (count > 1)
		camera.face = (enum cube_face)index;
	scene_camera_axes(&camera, view.axes);
	view.tangent[1] = cube ? 1 : tan(0.5 * camera.vertical_fov_deg * M_PI / 180);
	view.tangent[0] = view.tangent[1] * view.width / view.height;
	return view;
}

double camera_pixel_angle(const struct camera_view *view)
{
	/* Panoramas show 180 degrees from top to bottom; the fisheye's circles and the lines of equal elevation are shorter than that. */
	return (view->projection == PROJECTION_PERSPECTIVE ? 2 * view->tangent[1] : M_PI) / view->height;
}

/* --- perspective ------------------------------------------------------------------------------------------------------------------ */

static void perspective_direction(const struct camera_view *view, const double at[2], double direction[3])
{
	const double x = (2 * at[0] / view->width - 1) * view->tangent[0];
	const double y = (1 - 2 * (at[1] - view->first_row) / view->height) * view->tangent[1];
	const double scale = 1 / sqrt(1 + x * x + y * y);
	for (int i = 0; i < 3; i++)
		direction[i] = scale * (view->axes[2][i] + x * view->axes[0][i] + y * view->axes[1][i]);
}

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static bool perspective_project(const struct camera_view *view, const double direction[3], double at[2])
{
	const double depth = dot(direction, view->axes[2]);
	at[0] = at[1] = -1;
	if (depth <= 0)
		return false;
	const double x = dot(direction, view->axes[0]) / depth / view->tangent[0];
	const double y = dot(direction, view->axes[1]) / depth / view->tangent[1];
	at[0] = 0.5 * (1 + x) * view->width;
	at[1] = view->first_row + 0.5 * (1 - y) * view->height;
	return fabs(x) <= 1 && fabs(y) <= 1;
}

/* Solid angle of a rectangle at distance 1, from its foot to (x, y). */
static double corner_solid_angle(double x, double y)
{
	return atan2(x * y, sqrt(1 + x * x + y * y));
}

static double perspective_solid_angle(const struct camera_view *view, int column, int row)
{
	const double x[2] = {(2.0 * column / view->width - 1) * view->tangent[0],
			     (2.0 * (column + 1) / view->width - 1) * view->tangent[0]};
	const double y[2] = {(2.0 * row / view->height - 1) * view->tangent[1], (2.0 * (row + 1) / view->height - 1) * view->tangent[1]};
	return corner_solid_angle(x[1], y[1]) - corner_solid_angle(x[0], y[1]) - corner_solid_angle(x[1], y[0]) +
	       corner_solid_angle(x[0], y[0]);
}

/* --- fisheye ---------------------------------------------------------------------------------------------------------------------- */

/* sin(pi/2 r) / r */
static double sine_over_radius(double r)
{
	return r > 1e-9 ? sin(0.5 * M_PI * r) / r : 0.5 * M_PI;
}

static bool fisheye_direction(const struct camera_view *view, const double at[2], double direction[3])
{
	const double east = 1 - 2 * at[0] / view->width, north = 1 - 2 * at[1] / view->height, r = hypot(east, north);
	const double scale = r > 1 ? 1 / r : sine_over_radius(r);
	direction[0] = scale * east;
	direction[1] = scale * north;
	direction[2] = r > 1 ? 0 : cos(0.5 * M_PI * r);
	return r <= 1;
}

static bool fisheye_project(const struct camera_view *view, const double direction[3], double at[2])
{
	const double level = hypot(direction[0], direction[1]), zenith = atan2(level, direction[2]);
	const double scale = level > 0 ? zenith / (0.5 * M_PI) / level : 0;
	at[0] = 0.5 * view->width * (1 - scale * direction[0]);
	at[1] = 0.5 * view->height * (1 - scale * direction[1]);
	return direction[2] >= 0;
}

/* The mapping stretches circles by theta/sin(theta); integrated over the pixel by three points of Gauss and Legendre each way. */
static double fisheye_solid_angle(const struct camera_view *view, int column, int row)
{
	static const double node[3] = {-0.7745966692414834, 0, 0.7745966692414834}, weight[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
	const double area = M_PI * M_PI / ((double)view->width * view->height);
	double sum = 0;
	for (int i = 0; i < 3; i++)
		for (int k = 0; k < 3; k++) {
			const double x = 2 * (column + 0.5 + 0.5 * node[i]) / view->width - 1,
				     y = 2 * (row + 0.5 + 0.5 * node[k]) / view->height - 1;
			sum += weight[i] * weight[k] * sine_over_radius(hypot(x, y)) / (0.5 * M_PI);
		}
	return area * sum;
}

/* --- equirectangular -------------------------------------------------------------------------------------------------------------- */

static void equirectangular_direction(const struct camera_view *view, const double at[2], double direction[3])
{
	const double azimuth = 2 * M_PI * at[0] / view->width, elevation = M_PI * (0.5 - at[1] / view->height);
	direction[0] = cos(elevation) * sin(azimuth);
	direction[1] = cos(elevation) * cos(azimuth);
	direction[2] = sin(elevation);
}

static void equirectangular_project(const struct camera_view *view, const double direction[3], double at[2])
{
	const double azimuth = atan2(direction[0], direction[1]);
	at[0] = view->width * (azimuth < 0 ? azimuth / (2 * M_PI) + 1 : azimuth / (2 * M_PI));
	at[1] = view->height * (0.5 - atan2(direction[2], hypot(direction[0], direction[1])) / M_PI);
}

static double equirectangular_solid_angle(const struct camera_view *view, int row)
{
	const double middle = M_PI * (0.5 - (row + 0.5) / view->height), half = 0.5 * M_PI / view->height;
	return 2 * M_PI / view->width * 2 * cos(middle) * sin(half);
}

/* ---------------------------------------------------------------------------------------------------------------------------------- */

bool camera_direction(const struct camera_view *view, const double at[2], double direction[3])
{
	if (view->projection == PROJECTION_FISHEYE)
		return fisheye_direction(view, at, direction);
	if (view->projection == PROJECTION_EQUIRECTANGULAR)
		equirectangular_direction(view, at, direction);
	else
		perspective_direction(view, at, direction);
	return true;
}

bool camera_project(const struct camera_view *view, const double direction[3], double at[2])
{
	if (view->projection == PROJECTION_FISHEYE)
		return fisheye_project(view, direction, at);
	if (view->projection != PROJECTION_EQUIRECTANGULAR)
		return perspective_project(view, direction, at);
	equirectangular_project(view, direction, at);
	return true;
}

double camera_pixel_solid_angle(const struct camera_view *view, int column, int row)
{
	if (view->projection == PROJECTION_FISHEYE)
		return fisheye_solid_angle(view, column, row);
	if (view->projection == PROJECTION_EQUIRECTANGULAR)
		return equirectangular_solid_angle(view, row);
	return perspective_solid_angle(view, column, row - view->first_row);
}
