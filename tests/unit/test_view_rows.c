/* What rows of a picture are said to have in common (renderer/stages/view_rows.h) holds for each of their pixels, of cameras turned every
 * way. */
#include "renderer/stages/view_rows.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { WIDTH = 96, HEIGHT = 72, CAMERAS = 400 };

static const double radius = 6371000.0;

/* The same numbers on every machine. */
static double uniform(uint32_t *state, double low, double high)
{
	*state = *state * 1664525u + 1013904223u;
	return low + (high - low) * (*state >> 8) / 16777216.0;
}

struct looks {
	struct camera_view view;
	struct scene_block block;
};

static struct looks random_looks(uint32_t *state)
{
	struct looks looks;
	struct scene scene = scene_default();
	memset(&looks, 0, sizeof looks);
	scene.output.width = WIDTH;
	scene.output.height = HEIGHT;
	scene.camera.azimuth_deg = uniform(state, 0, 360);
	scene.camera.elevation_deg = uniform(state, 0, 1) < 0.5 ? uniform(state, -15, 25) : uniform(state, -90, 90);
	scene.camera.roll_deg = uniform(state, 0, 1) < 0.5 ? 0 : uniform(state, -180, 180);
	scene.camera.vertical_fov_deg = uniform(state, 2, 110);
	scene.camera.projection = uniform(state, 0, 1) < 0.2 ? PROJECTION_EQUIRECTANGULAR : PROJECTION_PERSPECTIVE;
	looks.view = camera_view_of(&scene, 0);
	looks.block.camera_position[2] = (float)uniform(state, 2, 1000);
	looks.block.camera_position[3] = (float)camera_pixel_angle(&looks.view);
	looks.block.cloud_layer[0] = (float)uniform(state, 1100, 8000);
	looks.block.cloud_layer[1] = 400;
	looks.block.cloud_layer[2] = 20000;
	looks.block.cloud_threshold[3] = 512;
	return looks;
}

static double sine_at(const struct camera_view *view, double column, double row)
{
	const double at[2] = {column, row};
	double direction[3];
	camera_direction(view, at, direction);
	return direction[2];
}

/* Cosine to the vertical at the layer's base of a ray that goes up with this sine. */
static double cosine_at_base(const struct scene_block *block, double sine)
{
	const double from = radius + block->camera_position[2], to = radius + block->cloud_layer[0];
	return sqrt(1 - from * from * (1 - sine * sine) / (to * to));
}

static void regions(void **state)
{
	uint32_t random = 1;
	int found[VIEW_REGIONS] = {0};
	(void)state;
	for (int i = 0; i < CAMERAS; i++) {
		const struct looks looks = random_looks(&random);
		const double horizon = -acos(radius / (radius + looks.block.camera_position[2]));
		const double half = 0.5 * looks.block.camera_position[3];
		for (int row = 0; row < HEIGHT; row++) {
			const enum view_region region = view_rows_region(&looks.block, &looks.view, false, row);
			found[region]++;
			for (int column = 0; column < WIDTH; column++) {
				const double above = sine_at(&looks.view, column + 0.5, row + 0.5) - sin(horizon);
				/* The program for either part knows nothing of pixels that the horizon crosses. */
				assert_true(region != VIEW_SKY || above > half);
				assert_true(region != VIEW_GROUND || above < -3 * half);
			}
		}
	}
	for (int i = 0; i < VIEW_REGIONS; i++)
		assert_true(found[i] > 1000);
}

/* Of a row whose pixels all look up. */
static void check_low(const struct looks *looks, int row, int found[VIEW_UP_REACHES])
{
	enum { PIECE = 32 };
	const enum view_up_reach reach = view_rows_reach(&looks->block, &looks->view, row);
	for (int first = 0; first < WIDTH; first += PIECE) {
		const enum view_up_reach piece =
			reach == VIEW_UP_SOME_LOW ? view_rows_low(&looks->block, &looks->view, row, row + 1, first, first + PIECE) : reach;
		found[piece]++;
		for (int column = first; column < first + PIECE; column++) {
			const double cosine = cosine_at_base(&looks->block, sine_at(&looks->view, column + 0.5, row + 0.5));
			assert_true(piece != VIEW_UP_LOW || cosine < 0.3);
			assert_true((piece != VIEW_UP_FAR && piece != VIEW_UP_NEAR) || cosine >= 0.34);
		}
	}
}

static void low_views(void **state)
{
	uint32_t random = 2;
	int found[VIEW_UP_REACHES] = {0};
	(void)state;
	for (int i = 0; i < CAMERAS; i++) {
		const struct looks looks = random_looks(&random);
		for (int row = 0; row < HEIGHT; row++)
			if (view_rows_region(&looks.block, &looks.view, false, row) == VIEW_SKY)
				check_low(&looks, row, found);
	}
	for (int i = 0; i < VIEW_UP_REACHES; i++)
		assert_true(found[i] > 100);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(regions), cmocka_unit_test(low_views)};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
