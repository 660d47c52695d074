/* Coverage means coverage: the share of the sky overhead that holds cloud. */
#include "tests/unit/test_renderer_common.h"

/* Cameras whose pictures, side by side, show every place of the tile once. */
enum { PLACES = 4, SIDE = 128 };

static struct scene looking_up(enum cloud_type type, uint32_t seed, double coverage)
{
	struct scene scene = small_scene(SIDE, SIDE, LAYER(OPTICAL_THICKNESS));
	scene.clouds.type = type;
	scene.clouds.seed = seed;
	scene.clouds.coverage = coverage;
	scene.clouds.base_m = 5000;
	scene.camera.position_m[2] = 1;
	scene.camera.elevation_deg = 90;
	scene.camera.vertical_fov_deg = 2 * atan(0.5 * scene.clouds.tile_m / PLACES / scene.clouds.base_m) / DEGREE;
	scene.radiosity.enabled = false;
	return scene;
}

/* Share of pixels thicker than `threshold`. */
static double share_covered(struct scene scene, double threshold)
{
	int covered = 0;
	for (int place = 0; place < PLACES * PLACES; place++) {
		scene.camera.position_m[0] = scene.clouds.tile_m * (place % PLACES) / PLACES;
		scene.camera.position_m[1] = scene.clouds.tile_m * floor((double)place / PLACES) / PLACES;
		struct frame frame = render(&scene);
		for (int i = 0; i < SIDE * SIDE; i++)
			covered += pixel_of(&frame, LAYER_OPTICAL_THICKNESS, i % SIDE, i / SIDE)[0] > threshold;
		frame_finish(&frame);
	}
	return (double)covered / (SIDE * SIDE * PLACES * PLACES);
}

static void check_coverage(enum cloud_type type)
{
	static const double coverages[] = {0.3, 0.5, 0.7, 0.9};
	for (int i = 0; i < 4; i++)
		for (uint32_t seed = 1; seed <= 2; seed++) {
			const struct scene scene = looking_up(type, seed, coverages[i]);
			const double share = share_covered(scene, 0.1);
			print_message("%s, seed %u, coverage %.1f: %.3f\n", scene_cloud_type_names[type], seed, coverages[i], share);
			assert_float_equal(share, coverages[i], 0.03);
		}
}

static void stratus_covers_what_it_says(void **state)
{
	(void)state;
	check_coverage(CLOUD_STRATUS);
}

static void stratocumulus_covers_what_it_says(void **state)
{
	(void)state;
	check_coverage(CLOUD_STRATOCUMULUS);
}

static void ends_of_the_range(void **state)
{
	(void)state;
	for (int type = CLOUD_STRATUS; type <= CLOUD_STRATOCUMULUS; type++) {
		assert_float_equal(share_covered(looking_up((enum cloud_type)type, 3, 0), 0.05), 0, 0);
		assert_true(share_covered(looking_up((enum cloud_type)type, 3, 1), 0.3) > 0.999);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(stratus_covers_what_it_says),
		cmocka_unit_test(stratocumulus_covers_what_it_says),
		cmocka_unit_test(ends_of_the_range),
	};
	return RUN_WITH_RENDERER(tests);
}
