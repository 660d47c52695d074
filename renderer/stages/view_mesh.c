#include "renderer/stages/view_mesh.h"

#include <math.h>

/* Angles, rad. Light around the sun, first of all the droplets' and the haze's aureole, changes by its own size over about its distance
 * from the sun; what the air adds does so over the height above the horizon. */
static const double cell_largest = 0.040, cell_smallest = 0.012, around_sun = 0.085, share_of_distance = 0.16;
static const double lowest_shown = 0.05; /* sine of elevation */
enum { CELL_PIXELS = 1 };

bool view_mesh_shows(const struct camera_view *view, double lowest_sine)
{
	const bool upright = fabs(view->axes[0][2]) < 1e-3 && view->axes[1][2] > 0;
	return view->projection == PROJECTION_PERSPECTIVE && upright && lowest_sine > lowest_shown;
}

/* Where in the picture the sun stands; false when it is not before the camera. */
static bool find_sun(const struct scene_block *block, const struct camera_view *view, double at[2])
{
	const double sun[3] = {block->sun_direction[0], block->sun_direction[1], block->sun_direction[2]};
	double ahead = 0;
	for (int i = 0; i < 3; i++)
		ahead += sun[i] * view->axes[2][i];
	camera_project(view, sun, at);
	return ahead > 0.1;
}

static int clamp_to(double x, int from, int to)
{
	return (int)fmin(fmax(x, from), to);
}

struct view_mesh_part view_mesh_around_sun(const struct scene_block *block, const struct camera_view *view, int first_row, int end_row)
{
	double at[2];
	struct view_mesh_part part = {0};
	if (!find_sun(block, view, at))
		return part;
	/* A pixel off the axis is smaller. */
	const double x = (2 * at[0] / view->width - 1) * view->tangent[0];
	const double y = (2 * (at[1] - view->first_row) / view->height - 1) * view->tangent[1];
	const double slant = 1 + x * x + y * y, reach = around_sun / camera_pixel_angle(view);
	const double across = reach * sqrt(slant * (1 + x * x)), along = reach * sqrt(slant * (1 + y * y));
	part.first_column = clamp_to(floor(at[0] - across), 0, view->width);
	part.end_column = clamp_to(ceil(at[0] + across), 0, view->width);
	part.first_row = clamp_to(floor(at[1] - along), first_row, end_row);
	part.end_row = clamp_to(ceil(at[1] + along), first_row, end_row);
	return part;
}

/* Lines from `from` to `to`: as far from each other as the distance from up to two places allows. */
static int place_lines(float *lines, double from, double to, const double *places, int place_count, double pixel_angle)
{
	int count = 0;
	for (double at = from; at < to - 0.5 && count < VIEW_MESH_LINES_MAX - 1; count++) {
		double cell = cell_largest;
		for (int i = 0; i < place_count; i++) {
			/* The next line is meant, where it lies nearer. */
			const double distance = fabs(places[i] - at) * pixel_angle;
			cell = fmin(cell, share_of_distance * (places[i] > at ? distance / (1 + share_of_distance) : distance));
		}
		lines[count] = (float)at;
		at += fmax(fmax(cell, cell_smallest) / pixel_angle, CELL_PIXELS);
	}
	lines[count++] = (float)to;
	return count;
}

void view_mesh_run(const struct pass *pass, const struct scene_block *block, const struct camera_view *view, const struct pass_run *run,
		   int first_row, int end_row)
{
	float columns[VIEW_MESH_LINES_MAX], rows[VIEW_MESH_LINES_MAX];
	const double angle = camera_pixel_angle(view);
	double sun[2];
	const bool has_sun = find_sun(block, view, sun);
	/* Row of the horizon, of an upright camera. */
	const double horizon =
		view->first_row + view->height * 0.5 * (1 + view->axes[2][2] / fmax(view->axes[1][2], 1e-3) / view->tangent[1]);
	const double places[2] = {horizon, sun[1]};
	const struct pass_mesh mesh = {.columns = columns,
				       .rows = rows,
				       .column_count = place_lines(columns, 0, view->width, &sun[0], has_sun, angle),
				       .row_count = place_lines(rows, first_row, end_row, places, has_sun ? 2 : 1, angle)};
	struct pass_run with_mesh = *run;
	with_mesh.mesh = &mesh;
	with_mesh.first_row = first_row;
	with_mesh.height = end_row - first_row;
	with_mesh.arguments[0][0] = (float)cell_largest;
	pass_run(pass, &with_mesh);
}
