#include "renderer/stages/view_rows.h"

#include <math.h>

double view_rows_horizon(const struct scene_block *block, double height)
{
	const double radius = 6371000.0, h = block->camera_position[2];
	return h < height ? 1 : -sqrt((h - height) * (2 * radius + h + height)) / (radius + h);
}

/* Least and greatest sine of the elevation along a row of pixels. That of a perspective rises and falls at most once along a row, so that
 * its ends, its middle and points between bound it, but for the bulge between those: of (p + q x) / sqrt(a + x^2) with a >= 1 the second
 * derivative is 2 |q| + 4 |itself| at most, and about 1 at most anyway. */
static void bound_row(const struct camera_view *view, int row, double *lowest, double *highest)
{
	enum { PROBES = 16 };
	*lowest = 1;
	*highest = -1;
	for (int i = 0; i <= PROBES; i++) {
		const double at[2] = {(double)view->width * i / PROBES, row + 0.5};
		double direction[3];
		camera_direction(view, at, direction);
		*lowest = fmin(*lowest, direction[2]);
		*highest = fmax(*highest, direction[2]);
	}
	if (view->projection != PROJECTION_PERSPECTIVE)
		return;
	const double steepest = fabs(view->axes[0][2]) + 2 * fmax(fabs(*lowest), fabs(*highest));
	const double bulge = pow(view->tangent[0] / PROBES, 2) * fmin(steepest, 1);
	*lowest -= bulge;
	*highest += bulge;
}

enum view_region view_rows_region(const struct scene_block *block, const struct camera_view *view, bool above, int row)
{
	const double pixel = camera_pixel_angle(view), ground = view_rows_horizon(block, 0);
	/* From above, rays that miss the ground may still graze the layer. */
	const double sky = above ? view_rows_horizon(block, block->cloud_layer[0] + block->cloud_layer[1]) : ground;
	double lowest, highest;
	if (view->projection == PROJECTION_FISHEYE)
		return sky < -1e-6 ? VIEW_SKY : VIEW_MIXED; /* it ends at elevation 0 */
	bound_row(view, row, &lowest, &highest);
	/* A pixel that is crossed by the horizon shows both; a crest of the layer is higher than that. */
	if (lowest > sky + (above ? 2 : 1) * pixel + 1e-6)
		return VIEW_SKY;
	return highest < ground - 2 * pixel - 1e-6 ? VIEW_GROUND : VIEW_MIXED;
}

/* Is no pixel of a row, all above the horizon, larger than half a texel of the field or a texel of the thickness evened out? */
static bool row_is_near(const struct scene_block *block, const struct camera_view *view, int row)
{
	const double radius = 6371000.0, h = block->camera_position[2], base = block->cloud_layer[0];
	const double texels = fmax(2 * block->cloud_threshold[3], 256);
	double lowest, highest;
	bound_row(view, row, &lowest, &highest);
	const double b = (radius + h) * lowest, distance = sqrt(b * b + (base - h) * (2 * radius + base + h)) - b;
	const double mu_v = ((radius + h) * lowest + distance) / (radius + base);
	/* As camera_footprint in shaders/lib/camera.glsl. */
	const double slant = view->projection == PROJECTION_FISHEYE ? mu_v : sqrt(mu_v);
	/* And none so far away that the tile is warped: FIELD_WARP_BEGIN in shaders/lib/field_warp.glsl. */
	const double across = distance * sqrt(fmax(0, 1 - lowest * lowest));
	if (block->cloud_warp[3] > 0 && across > 0.5 * block->cloud_layer[2])
		return false;
	return mu_v > 0.01 && block->camera_position[3] * distance / slant < block->cloud_layer[2] / texels;
}

/* Cosine to the vertical at the layer's base of a direction of this sine of elevation, or of one at the horizon if it is below that. */
static double cosine_at_base(const struct scene_block *block, double sine)
{
	sine = fmax(sine, view_rows_horizon(block, 0));
	const double radius = 6371000.0, h = block->camera_position[2], base = block->cloud_layer[0];
	return sqrt(pow((radius + h) * sine, 2) + (base - h) * (2 * radius + base + h)) / (radius + base);
}

/* Of pixels between two sines of elevation. SIDE_LOW_ALL and SIDE_LOW_NONE in shaders/lib/side_low.glsl. */
static enum view_up_reach reach_between(const struct scene_block *block, double lowest, double highest)
{
	if (cosine_at_base(block, lowest) >= 0.34)
		return VIEW_UP_FAR;
	return cosine_at_base(block, fmin(highest, 1)) < 0.3 ? VIEW_UP_LOW : VIEW_UP_SOME_LOW;
}

enum view_up_disc view_rows_disc(const struct scene_block *block, bool large_sun, int row)
{
	if (large_sun)
		return VIEW_UP_LARGE_DISC;
	const bool within = row >= block->sun_disc_box[1] && row < block->sun_disc_box[1] + block->sun_disc_box[3];
	return within ? VIEW_UP_SMALL_DISC : VIEW_UP_NO_DISC;
}

enum view_up_reach view_rows_reach(const struct scene_block *block, const struct camera_view *view, int row)
{
	double lowest, highest;
	bound_row(view, row, &lowest, &highest);
	const enum view_up_reach reach = reach_between(block, lowest, highest);
	if (reach != VIEW_UP_FAR)
		return reach;
	return row_is_near(block, view, row) ? VIEW_UP_NEAR : VIEW_UP_FAR;
}

enum view_up_reach view_rows_low(const struct scene_block *block, const struct camera_view *view, int first_row, int end_row,
				 int first_column, int end_column)
{
	/* What lies between the corners bulges by the square of their distance at most. */
	const double size = camera_pixel_angle(view) * fmax(end_row - first_row, end_column - first_column), bulge = size * size;
	double lowest = 1, highest = -1;
	for (int i = 0; i < 4; i++) {
		const double at[2] = {i & 1 ? end_column : first_column, i & 2 ? end_row : first_row};
		double direction[3];
		camera_direction(view, at, direction);
		lowest = fmin(lowest, direction[2] - bulge);
		highest = fmax(highest, direction[2] + bulge);
	}
	return reach_between(block, lowest, highest);
}
