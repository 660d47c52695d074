/* Projections against their definitions, and the sun's disc spread over them, without a renderer. */
#include "renderer/camera.h"
#include "renderer/sun_disc.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define DEGREE     (M_PI / 180)
#define SUN_RADIUS (0.5 * 0.533 * DEGREE)

static struct scene scene_of(enum projection projection, int width)
{
	struct scene scene = scene_default();
	scene.camera.projection = projection;
	const struct scene_shape shape = scene_camera_shape(&scene.camera);
	scene.output.width = width;
	scene.output.height = shape.ratio[0] ? width * shape.ratio[1] / shape.ratio[0] : width * 3 / 4;
	return scene;
}

static void direction_of(double azimuth_deg, double elevation_deg, double direction[3])
{
	direction[0] = cos(elevation_deg * DEGREE) * sin(azimuth_deg * DEGREE);
	direction[1] = cos(elevation_deg * DEGREE) * cos(azimuth_deg * DEGREE);
	direction[2] = sin(elevation_deg * DEGREE);
}

static void assert_direction(const double found[3], double east, double north, double up)
{
	const double wanted[3] = {east, north, up};
	for (int i = 0; i < 3; i++)
		assert_float_equal(found[i], wanted[i], 1e-12);
}

static void look(const struct camera_view *view, double x, double y, double direction[3])
{
	const double at[2] = {x, y};
	camera_direction(view, at, direction);
}

/* --- definitions ------------------------------------------------------------------------------------------------------------------ */

static void fisheye_has_east_on_the_left(void **state)
{
	(void)state;
	const struct scene scene = scene_of(PROJECTION_FISHEYE, 100);
	const struct camera_view view = camera_view_of(&scene, 0);
	double d[3];
	const double corner[2] = {2, 2};
	look(&view, 50, 50, d);
	assert_direction(d, 0, 0, 1);
	look(&view, 50, 0, d);
	assert_direction(d, 0, 1, 0);
	look(&view, 0, 50, d);
	assert_direction(d, 1, 0, 0);
	look(&view, 100, 50, d);
	assert_direction(d, -1, 0, 0);
	look(&view, 50, 75, d); /* half way to the rim */
	assert_direction(d, 0, -sqrt(0.5), sqrt(0.5));
	assert_false(camera_direction(&view, corner, d));
	assert_float_equal(d[2], 0, 1e-12);
}

static void equirectangular_begins_in_the_north(void **state)
{
	(void)state;
	const struct scene scene = scene_of(PROJECTION_EQUIRECTANGULAR, 200);
	const struct camera_view view = camera_view_of(&scene, 0);
	double d[3];
	look(&view, 0, 50, d);
	assert_direction(d, 0, 1, 0);
	look(&view, 50, 50, d);
	assert_direction(d, 1, 0, 0);
	look(&view, 100, 50, d);
	assert_direction(d, 0, -1, 0);
	look(&view, 100, 25, d);
	assert_direction(d, 0, -sqrt(0.5), sqrt(0.5));
	look(&view, 70, 0, d);
	assert_direction(d, 0, 0, 1);
}

/* Corners of the faces as ImfEnvmap.h draws them: the cube's corner whose number has bit 0 for +x, bit 1 for +y, and bit 2 for +z (in the
 * file's axes), at the upper left, upper right, lower left and lower right of each face. */
static void faces_lie_as_openexr_draws_them(void **state)
{
	(void)state;
	static const int corners[6][4] = {{3, 7, 1, 5}, {6, 2, 4, 0}, {6, 7, 2, 3}, {0, 1, 4, 5}, {7, 6, 5, 4}, {2, 3, 0, 1}};
	const struct scene whole = scene_of(PROJECTION_CUBEMAP, 64);
	assert_int_equal(camera_view_count(&whole), 6);
	for (int face = 0; face < 6; face++) {
		const struct camera_view view = camera_view_of(&whole, face);
		assert_int_equal(view.first_row, 64 * face);
		for (int i = 0; i < 4; i++) {
			const double sign[3] = {corners[face][i] & 1 ? 1 : -1, corners[face][i] & 2 ? 1 : -1,
						corners[face][i] & 4 ? 1 : -1};
			double d[3];
			look(&view, i & 1 ? 64 : 0, view.first_row + (i & 2 ? 64 : 0), d);
			assert_direction(d, sign[0] / sqrt(3), -sign[2] / sqrt(3), sign[1] / sqrt(3));
		}
		struct scene single = scene_of(PROJECTION_CUBEMAP, 64);
		single.camera.face = (enum cube_face)face;
		single.output.height = 64;
		const struct camera_view alone = camera_view_of(&single, 0);
		assert_int_equal(camera_view_count(&single), 1);
		assert_memory_equal(alone.axes, view.axes, sizeof view.axes);
		assert_int_equal(alone.first_row, 0);
	}
}

static void points_and_directions_go_round(void **state)
{
	(void)state;
	for (int projection = 0; projection < PROJECTION_COUNT; projection++) {
		struct scene scene = scene_of(projection, 96);
		scene.camera.roll_deg = 25;
		for (int i = 0; i < camera_view_count(&scene); i++) {
			const struct camera_view view = camera_view_of(&scene, i);
			for (double x = 0.25; x < view.width; x += 7)
				for (double y = 0.25; y < view.height; y += 5) {
					double at[2] = {x, view.first_row + y}, d[3], back[2];
					const bool shown = camera_direction(&view, at, d);
					assert_float_equal(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1, 1e-12);
					if (!shown)
						continue;
					assert_true(camera_project(&view, d, back));
					assert_float_equal(back[0], at[0], 1e-9);
					assert_float_equal(back[1], at[1], 1e-9);
				}
		}
	}
}

/* Solid angles from the directions of a pixel's surroundings, by the cross product of small steps: nothing of the closed forms. */
static double stepped_solid_angle(const struct camera_view *view, int column, int row)
{
	enum { STEPS = 8 };
	const double h = 1e-4;
	double sum = 0;
	for (int i = 0; i < STEPS * STEPS; i++) {
		const double x = column + (i % STEPS + 0.5) / STEPS, y = row + ((double)(i / STEPS) + 0.5) / STEPS;
		double left[3], right[3], above[3], below[3], a[3], b[3];
		look(view, x - h, y, left);
		look(view, x + h, y, right);
		look(view, x, y - h, above);
		look(view, x, y + h, below);
		for (int k = 0; k < 3; k++)
			a[k] = (right[k] - left[k]) / (2 * h), b[k] = (below[k] - above[k]) / (2 * h);
		const double cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
		sum += sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]) / (STEPS * STEPS);
	}
	return sum;
}

static void solid_angles_are_those_of_the_pixels(void **state)
{
	(void)state;
	for (int projection = 0; projection < PROJECTION_COUNT; projection++)
		for (int width = 16; width <= 64; width *= 4) {
			const struct scene scene = scene_of(projection, width);
			double sum = 0;
			for (int i = 0; i < camera_view_count(&scene); i++) {
				const struct camera_view view = camera_view_of(&scene, i);
				for (int y = view.first_row; y < view.first_row + view.height; y++)
					for (int x = 0; x < view.width; x++) {
						const double corner = hypot(2.0 * fabs(x + 0.5 - 0.5 * width) / width + 1.0 / width,
									    2.0 * fabs(y + 0.5 - 0.5 * width) / width + 1.0 / width);
						const double omega = camera_pixel_solid_angle(&view, x, y);
						sum += omega;
						if (projection == PROJECTION_FISHEYE && corner > 1)
							continue;
						assert_float_equal(omega / stepped_solid_angle(&view, x, y), 1, 2e-3);
					}
			}
			if (projection == PROJECTION_EQUIRECTANGULAR || projection == PROJECTION_CUBEMAP)
				assert_float_equal(sum / (4 * M_PI), 1, 1e-9);
		}
}

/* --- the sun's disc ----------------------------------------------------------------------------------------------------------------- */

struct spread {
	double light;     /* sum of weights times solid angles over the whole picture */
	double across[3]; /* the direction that it comes from, times light */
	double least;
};

/* As users of a file take it: of a fisheye, whose outermost pixels reach beyond the rim, the stretch at the pixel's centre. */
static double used_solid_angle(const struct camera_view *view, int column, int row)
{
	if (view->projection != PROJECTION_FISHEYE)
		return stepped_solid_angle(view, column, row);
	const double step = M_PI / view->width, zenith = step * hypot(column + 0.5 - 0.5 * view->width, row + 0.5 - 0.5 * view->height);
	return step * step * (zenith > 0 ? sin(zenith) / zenith : 1);
}

static struct spread spread_over(const struct scene *scene, const double sun[3])
{
	struct spread spread = {0};
	for (int i = 0; i < camera_view_count(scene); i++) {
		const struct camera_view view = camera_view_of(scene, i);
		struct sun_disc disc;
		assert_true(sun_disc_init(&disc, &view, sun, SUN_RADIUS, -8e-4, NULL));
		assert_false(disc.large);
		for (int k = 0; k < disc.width * disc.height; k++) {
			const int column = (disc.column + k % disc.width) % view.width, row = disc.row + k / disc.width;
			double d[3];
			assert_true(row >= view.first_row && row < view.first_row + view.height);
			assert_true(isfinite(disc.weights[k]) && disc.weights[k] >= 0);
			look(&view, column + 0.5, row + 0.5, d);
			const double light = disc.weights[k] * used_solid_angle(&view, column, row);
			spread.light += light;
			for (int n = 0; n < 3; n++)
				spread.across[n] += light * d[n];
		}
		sun_disc_finish(&disc);
	}
	return spread;
}

/* Suns that are hard for one projection or another: on the wrap, on edges and corners of the cube, at the zenith, on the horizon. */
static const double suns[][2] = {{0, 30},   {359.9, 10}, {180, 90}, {12, 89.9},    {45, 0.5},    {45, 35.26438968},
				 {135, 45}, {90, 45},    {270, 2},  {225, 20.1},   {315, 70.77}, {200.3, 0.2},
				 {45, 20},  {89.9, 1},   {140, 35}, {300.123, 5.4}};

static void disc_adds_up_to_the_beam(void **state)
{
	(void)state;
	static const int widths[PROJECTION_COUNT][6] = {
		[PROJECTION_FISHEYE] = {16, 17, 64, 301, 1024, 8192},
		[PROJECTION_EQUIRECTANGULAR] = {32, 34, 64, 300, 2048, 8192},
		[PROJECTION_CUBEMAP] = {16, 17, 64, 301, 512, 1365},
	};
	for (int projection = PROJECTION_FISHEYE; projection < PROJECTION_COUNT; projection++)
		for (int size = 0; size < 6; size++) {
			double worst = 0, farthest = 0;
			for (size_t i = 0; i < sizeof suns / sizeof *suns; i++) {
				const struct scene scene = scene_of(projection, widths[projection][size]);
				const struct camera_view view = camera_view_of(&scene, 0);
				double sun[3], distance = 0;
				/* The fisheye ends at elevation 0. */
				if (projection == PROJECTION_FISHEYE && suns[i][1] * DEGREE < SUN_RADIUS)
					continue;
				direction_of(suns[i][0], suns[i][1], sun);
				const struct spread spread = spread_over(&scene, sun);
				for (int n = 0; n < 3; n++)
					distance += pow(spread.across[n] / spread.light - sun[n], 2);
				worst = fmax(worst, fabs(spread.light - 1));
				/* A disc cut by the rim or the horizon is not centred on the sun. */
				if (suns[i][1] > 4)
					farthest = fmax(farthest, sqrt(distance) / camera_pixel_angle(&view));
			}
			print_message("%s, %d wide: light within %.4f %%, direction within %.2f pixels\n",
				      scene_projection_names[projection], widths[projection][size], 100 * worst, farthest);
			assert_true(worst < 0.003);
			assert_true(farthest < 0.75); /* half a pixel in each direction */
		}
}

/* Perspectives from coarse to where the disc becomes too large for a table. */
static void disc_adds_up_in_perspectives(void **state)
{
	(void)state;
	static const double fovs[] = {4, 12, 60, 150};
	for (size_t i = 0; i < sizeof fovs / sizeof *fovs; i++)
		for (int width = 16; width <= 1024; width *= 4) {
			struct scene scene = scene_of(PROJECTION_PERSPECTIVE, width);
			double sun[3];
			scene.camera.vertical_fov_deg = fovs[i];
			const struct camera_view view = camera_view_of(&scene, 0);
			const double at[2] = {0.7 * view.width, 0.4 * view.height};
			camera_direction(&view, at, sun);
			if (M_PI * pow(SUN_RADIUS / camera_pixel_angle(&view), 2) > 300)
				continue;
			assert_float_equal(spread_over(&scene, sun).light, 1, 0.002);
		}
}

/* The wrap: a box that goes on at the left edge, no wider than it must be. */
static void disc_on_the_wrap_is_small(void **state)
{
	(void)state;
	const struct scene scene = scene_of(PROJECTION_EQUIRECTANGULAR, 2048);
	const struct camera_view view = camera_view_of(&scene, 0);
	struct sun_disc disc;
	double sun[3];
	direction_of(0, 30, sun);
	assert_true(sun_disc_init(&disc, &view, sun, SUN_RADIUS, 0, NULL));
	assert_in_range(disc.width, 4, 6);
	assert_in_range(disc.height, 4, 5);
	assert_in_range(disc.column, 2045, 2047);
	sun_disc_finish(&disc);
}

/* Against a disc integrated ring by ring: darker to the limb, in the ratio that the law of darkening says. */
static void disc_is_darker_at_its_limb(void **state)
{
	(void)state;
	struct scene scene = scene_of(PROJECTION_PERSPECTIVE, 400);
	double sun[3];
	scene.camera.vertical_fov_deg = 6;
	scene.camera.azimuth_deg = 90;
	scene.camera.elevation_deg = 40;
	direction_of(90, 40, sun);
	const struct camera_view view = camera_view_of(&scene, 0);
	struct sun_disc disc;
	assert_true(sun_disc_init(&disc, &view, sun, SUN_RADIUS, 0, NULL));
	assert_false(disc.large);
	assert_in_range(disc.width, 26, 28);
	const double middle = disc.weights[disc.height / 2 * disc.width + disc.width / 2];
	/* At 0.8 of the radius: 1 - 0.6 (1 - 0.6) = 0.76. */
	const double limb =
		disc.weights[disc.height / 2 * disc.width + (int)(0.5 * disc.width + 0.8 * SUN_RADIUS / camera_pixel_angle(&view))];
	assert_float_equal(middle * M_PI * SUN_RADIUS * SUN_RADIUS, 1 / 0.8, 0.03);
	assert_float_equal(limb / middle, 0.76, 0.04);
	sun_disc_finish(&disc);
}

/* Half below the horizon: what is left carries all of the light, and none lies on the ground. */
static void setting_disc_stays_above_the_horizon(void **state)
{
	(void)state;
	for (int width = 16; width <= 4096; width *= 4) {
		const struct scene scene = scene_of(PROJECTION_EQUIRECTANGULAR, 2 * width);
		const struct camera_view view = camera_view_of(&scene, 0);
		struct sun_disc disc;
		double sun[3], sum = 0;
		direction_of(77, -2, sun);
		assert_true(sun_disc_init(&disc, &view, sun, SUN_RADIUS, sin(-2 * DEGREE), NULL));
		assert_float_equal(disc.visible, 0.5, 0.01);
		for (int k = 0; k < disc.width * disc.height; k++) {
			const int row = disc.row + k / disc.width;
			double d[3];
			look(&view, disc.column + k % disc.width + 0.5, row + 0.5, d);
			assert_true(disc.weights[k] == 0 || d[2] > sin(-2 * DEGREE));
			sum += disc.weights[k] * camera_pixel_solid_angle(&view, disc.column + k % disc.width, row);
		}
		assert_float_equal(sum, 1, 1e-5);
		sun_disc_finish(&disc);
	}
}

static void disc_out_of_the_picture_is_nothing(void **state)
{
	(void)state;
	struct sun_disc disc;
	double sun[3];
	for (double azimuth = 0; azimuth < 360; azimuth += 30) {
		const struct scene scene = scene_of(PROJECTION_PERSPECTIVE, 64);
		const struct camera_view view = camera_view_of(&scene, 0); /* azimuth 140, elevation 20 */
		direction_of(azimuth, 5, sun);
		assert_true(sun_disc_init(&disc, &view, sun, SUN_RADIUS, 0, NULL));
		assert_int_equal(disc.width > 0, azimuth == 120 || azimuth == 150);
		sun_disc_finish(&disc);
		/* Set: below the horizon as a whole. */
		direction_of(azimuth, -1, sun);
		assert_true(sun_disc_init(&disc, &view, sun, SUN_RADIUS, 0, NULL));
		assert_int_equal(disc.width, 0);
		sun_disc_finish(&disc);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(fisheye_has_east_on_the_left),         cmocka_unit_test(equirectangular_begins_in_the_north),
		cmocka_unit_test(faces_lie_as_openexr_draws_them),      cmocka_unit_test(points_and_directions_go_round),
		cmocka_unit_test(solid_angles_are_those_of_the_pixels), cmocka_unit_test(disc_adds_up_to_the_beam),
		cmocka_unit_test(disc_adds_up_in_perspectives),         cmocka_unit_test(disc_on_the_wrap_is_small),
		cmocka_unit_test(disc_is_darker_at_its_limb),           cmocka_unit_test(setting_disc_stays_above_the_horizon),
		cmocka_unit_test(disc_out_of_the_picture_is_nothing),
	};
	return cmocka_run_group_tests_name("camera", tests, NULL, NULL);
}
