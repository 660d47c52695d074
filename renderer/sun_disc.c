#include "renderer/sun_disc.h"

#include "renderer/log.h"

#include <math.h>
#include <stdlib.h>

enum {
	SAMPLES_PER_PIXEL = 64,
	SAMPLES_MIN = 4096,
	SAMPLES_MAX = 1 << 20,
	LARGE_PIXELS = 1024 /* where the disc is 36 pixels wide and its edge, which is all that pixels get wrong, a tenth of it */
};

/* Light of a part of the disc. */
struct sample {
	int column, row;
	double light;
	const float *passed; /* per band */
};

struct samples {
	struct sample *list;
	int count;
	const float *passed;   /* of the direction at hand */
	double visible, total; /* light of those above the horizon, and of all */
};

/* --- directions over the disc ----------------------------------------------------------------------------------------------------- */

/* Two directions square to one and to each other. */
static void perpendiculars(const double to[3], double a[3], double b[3])
{
	/* Duff et al. 2017, "Building an Orthonormal Basis, Revisited". */
	const double sign = copysign(1, to[2]), p = -1 / (sign + to[2]), q = to[0] * to[1] * p;
	a[0] = 1 + sign * to[0] * to[0] * p, a[1] = sign * q, a[2] = -sign * to[0];
	b[0] = q, b[1] = sign + to[1] * to[1] * p, b[2] = -to[1];
}

/* --- which pixels show the sky ------------------------------------------------------------------------------------------------------ */

static int wrapped(const struct camera_view *view, int column)
{
	if (view->projection != PROJECTION_EQUIRECTANGULAR)
		return column;
	return (column % view->width + view->width) % view->width;
}

static bool shows_sky(const struct camera_view *view, int column, int row, double horizon_sine)
{
	double direction[3];
	const double centre[2] = {column + 0.5, row + 0.5};
	if (column < 0 || column >= view->width || row < view->first_row || row >= view->first_row + view->height)
		return false;
	/* The renderer decides in single precision. */
	return camera_direction(view, centre, direction) && direction[2] > horizon_sine + 1e-6;
}

static void add(struct samples *samples, int column, int row, double light)
{
	samples->list[samples->count++] = (struct sample){column, row, light, samples->passed};
}

/* To the pixel around a point, or where that does not show the sky to the nearest neighbour that does. */
static void add_to_nearest(struct samples *samples, const struct camera_view *view, const double at[2], double horizon_sine, double light)
{
	const int column = (int)floor(at[0]), row = (int)floor(at[1]);
	int found[2] = {0};
	double nearest = INFINITY;
	for (int ring = 0; ring <= 1 && nearest == INFINITY; ring++)
		for (int y = row - ring; y <= row + ring; y++)
			for (int x = column - ring; x <= column + ring; x++) {
				const double distance = hypot(x + 0.5 - at[0], y + 0.5 - at[1]);
				if (distance >= nearest || !shows_sky(view, wrapped(view, x), y, horizon_sine))
					continue;
				nearest = distance;
				found[0] = wrapped(view, x);
				found[1] = y;
			}
	if (nearest < INFINITY)
		add(samples, found[0], found[1], light);
}

/* To the four pixels whose centres are around a point, so that their mean place is the point's: of a disc smaller than a pixel, the pixel
 * around it alone would be up to half a pixel off, and cosine integrals with it. */
static void add_between(struct samples *samples, const struct camera_view *view, const double at[2], double horizon_sine, double light)
{
	const int column = (int)floor(at[0] - 0.5), row = (int)floor(at[1] - 0.5);
	const double x = at[0] - 0.5 - column, y = at[1] - 0.5 - row;
	double shares[4], sum = 0;
	for (int i = 0; i < 4; i++) {
		const bool shown = shows_sky(view, wrapped(view, column + (i & 1)), row + (i >> 1), horizon_sine);
		shares[i] = shown ? (i & 1 ? x : 1 - x) * (i >> 1 ? y : 1 - y) : 0;
		sum += shares[i];
	}
	if (sum < 1e-6)
		add_to_nearest(samples, view, at, horizon_sine, light);
	for (int i = 0; i < 4 && sum >= 1e-6; i++)
		if (shares[i] > 0)
			add(samples, wrapped(view, column + (i & 1)), row + (i >> 1), light * shares[i] / sum);
}

/* --- spreading ---------------------------------------------------------------------------------------------------------------------- */

/* Of the cover's texel around a direction; x, y in radii along a and b. */
static const float *passed_at(const struct sun_cover *cover, double x, double y)
{
	static const float all[3] = {1, 1, 1};
	if (!cover)
		return all;
	const int column = (int)(0.5 * (x + 1) * SUN_COVER_SIDE), row = (int)(0.5 * (y + 1) * SUN_COVER_SIDE);
	const int last = SUN_COVER_SIDE - 1;
	return cover->share[row < 0 ? 0 : row > last ? last : row][column < 0 ? 0 : column > last ? last : column];
}

static double limb(double area)
{
	return 1 - SUN_LIMB_DARKENING * (1 - sqrt(1 - area));
}

void sun_cover_clear(struct sun_cover *cover, const double sun[3])
{
	double a[3], b[3];
	perpendiculars(sun, a, b);
	for (int i = 0; i < 3; i++)
		cover->a[i] = (float)a[i], cover->b[i] = (float)b[i];
	for (int i = 0; i < SUN_COVER_SIDE * SUN_COVER_SIDE; i++)
		for (int band = 0; band < 4; band++)
			cover->share[i / SUN_COVER_SIDE][i % SUN_COVER_SIDE][band] = 1;
}

void sun_cover_mean(const struct sun_cover *cover, double mean[3])
{
	enum { COUNT = 4096 };
	double total = 0;
	mean[0] = mean[1] = mean[2] = 0;
	for (int i = 0; i < COUNT; i++) {
		const double area = (i + 0.5) / COUNT, angle = i * M_PI * (3 - sqrt(5)), light = limb(area);
		const float *passed = passed_at(cover, sqrt(area) * cos(angle), sqrt(area) * sin(angle));
		total += light;
		for (int band = 0; band < 3; band++)
			mean[band] += light * passed[band];
	}
	for (int band = 0; band < 3; band++)
		mean[band] /= total;
}

static void spread(struct samples *samples, int count, const struct camera_view *view, const double sun[3], double radius,
		   double horizon_sine, const struct sun_cover *cover)
{
	/* Vogel's spiral: evenly dense in any direction, whatever shape the pixels have. */
	const double golden = M_PI * (3 - sqrt(5)), turn[2] = {cos(golden), sin(golden)};
	const bool soft = camera_pixel_angle(view) > radius;
	double a[3], b[3], heading[2] = {1, 0};
	perpendiculars(sun, a, b);
	for (int i = 0; i < count; i++) {
		const double area = (i + 0.5) / count, angle = radius * sqrt(area), across = sin(angle), along = cos(angle);
		const double x = across * heading[0], y = across * heading[1];
		const double direction[3] = {along * sun[0] + x * a[0] + y * b[0], along * sun[1] + x * a[1] + y * b[1],
					     along * sun[2] + x * a[2] + y * b[2]};
		const double light = limb(area);
		samples->passed = passed_at(cover, sqrt(area) * heading[0], sqrt(area) * heading[1]);
		const double next = heading[0] * turn[0] - heading[1] * turn[1];
		heading[1] = heading[0] * turn[1] + heading[1] * turn[0];
		heading[0] = next;
		samples->total += light;
		if (direction[2] <= horizon_sine)
			continue;
		samples->visible += light;
		double at[2];
		if (!camera_project(view, direction, at))
			continue;
		if (soft)
			add_between(samples, view, at, horizon_sine, light);
		else
			add_to_nearest(samples, view, at, horizon_sine, light);
	}
}

/* Columns to the right of `from`, -width/2..width/2 where the picture wraps. */
static int columns_from(const struct camera_view *view, int from, int column)
{
	const int difference = column - from;
	if (view->projection != PROJECTION_EQUIRECTANGULAR || abs(difference) <= view->width / 2)
		return difference;
	return difference + (difference < 0 ? view->width : -view->width);
}

static void bound(struct sun_disc *disc, const struct camera_view *view, const struct samples *samples)
{
	const int middle = samples->list[0].column; /* of the disc, where the spiral begins */
	int left = 0, right = 0, top = samples->list[0].row, bottom = top;
	for (int i = 0; i < samples->count; i++) {
		const int x = columns_from(view, middle, samples->list[i].column), y = samples->list[i].row;
		left = x < left ? x : left;
		right = x > right ? x : right;
		top = y < top ? y : top;
		bottom = y > bottom ? y : bottom;
	}
	disc->column = wrapped(view, middle + left);
	disc->row = top;
	disc->width = right - left + 1 < view->width ? right - left + 1 : view->width;
	disc->height = bottom - top + 1;
}

static bool fill(struct sun_disc *disc, const struct camera_view *view, const struct samples *samples)
{
	disc->weights = calloc((size_t)disc->width * (size_t)disc->height, sizeof *disc->weights);
	disc->passed = calloc((size_t)disc->width * (size_t)disc->height, sizeof *disc->passed);
	double *sums = calloc((size_t)disc->width * (size_t)disc->height, sizeof *sums);
	bool ok = disc->weights && disc->passed && sums;
	for (int i = 0; ok && i < samples->count; i++) {
		const int x = wrapped(view, samples->list[i].column - disc->column), y = samples->list[i].row - disc->row;
		sums[y * disc->width + x] += samples->list[i].light / samples->visible;
		for (int band = 0; band < 3; band++)
			disc->passed[y * disc->width + x][band] +=
				(float)(samples->list[i].light / samples->visible) * samples->list[i].passed[band];
	}
	for (int i = 0; ok && i < disc->width * disc->height; i++) {
		const int column = wrapped(view, disc->column + i % disc->width), row = disc->row + i / disc->width;
		disc->weights[i] = (float)(sums[i] / camera_pixel_solid_angle(view, column, row));
		for (int band = 0; band < 3; band++)
			disc->passed[i][band] = sums[i] > 0 ? (float)(disc->passed[i][band] / sums[i]) : 0;
	}
	free(sums);
	return ok;
}

/* How many pixels the disc covers, at its middle. 0 behind a perspective. */
static double pixels_of(const struct camera_view *view, const double sun[3], double radius)
{
	double at[2];
	camera_project(view, sun, at);
	if (view->projection == PROJECTION_PERSPECTIVE &&
	    sun[0] * view->axes[2][0] + sun[1] * view->axes[2][1] + sun[2] * view->axes[2][2] <= 0)
		return 0;
	const double limit = 1e6; /* beyond the edge of a perspective */
	const double x = fmin(fmax(at[0], -limit), limit), y = fmin(fmax(at[1], -limit), limit);
	return M_PI * radius * radius / camera_pixel_solid_angle(view, (int)floor(x), (int)floor(y));
}

/* Can any of the disc be in the picture? */
static bool may_show(const struct camera_view *view, const double sun[3], double radius)
{
	if (view->projection != PROJECTION_PERSPECTIVE)
		return true;
	const double corner = atan(hypot(view->tangent[0], view->tangent[1]));
	const double cosine = sun[0] * view->axes[2][0] + sun[1] * view->axes[2][1] + sun[2] * view->axes[2][2];
	return acos(fmin(fmax(cosine, -1), 1)) < corner + 2 * radius;
}

bool sun_disc_init(struct sun_disc *disc, const struct camera_view *view, const double sun[3], double radius, double horizon_sine,
		   const struct sun_cover *cover)
{
	*disc = (struct sun_disc){.visible = 1};
	if (!may_show(view, sun, radius))
		return true;
	const double pixels = pixels_of(view, sun, radius);
	disc->large = view->projection == PROJECTION_PERSPECTIVE && pixels > LARGE_PIXELS;
	const int count = disc->large ? SAMPLES_MIN : (int)fmin(fmax(SAMPLES_PER_PIXEL * pixels, SAMPLES_MIN), SAMPLES_MAX);
	struct samples samples = {.list = malloc(4 * (size_t)count * sizeof *samples.list)};
	bool ok = samples.list;
	if (ok) {
		spread(&samples, count, view, sun, radius, horizon_sine, cover);
		disc->visible = samples.visible / samples.total;
	}
	if (ok && !disc->large && samples.count > 0) {
		bound(disc, view, &samples);
		ok = fill(disc, view, &samples);
	}
	free(samples.list);
	if (!ok) {
		log_error("sun's disc: out of memory");
		sun_disc_finish(disc);
	}
	return ok;
}

void sun_disc_finish(struct sun_disc *disc)
{
	free(disc->passed);
	free(disc->weights);
	*disc = (struct sun_disc){0};
}
