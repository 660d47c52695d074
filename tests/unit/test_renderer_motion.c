/* Clouds in time: frame after frame nothing jumps, at any time of the range; and features live and die beside moving. */
#include "tests/unit/test_renderer_common.h"

enum { SIDE_X = 96, SIDE_Y = 72, PIXELS = SIDE_X * SIDE_Y, FRAMES = 48 };

static const double frames_per_second = 24;

static struct scene moving_scene(enum cloud_type type, double time)
{
	struct scene scene = small_scene(SIDE_X, SIDE_Y, LAYER(COLOR));
	scene.clouds.type = type;
	scene.clouds.time_s = time;
	scene.clouds.resolution = 128;
	scene.clouds.tile_m = 8000;
	scene.clouds.coverage = 0.6;
	if (type == CLOUD_ALTOCUMULUS || type == CLOUD_CIRROCUMULUS) {
		scene.clouds.base_m = type == CLOUD_ALTOCUMULUS ? 3000 : 7000;
		scene.clouds.thickness_m = type == CLOUD_ALTOCUMULUS ? 100 : 50;
	}
	/* Away from the sun's disc, whose edge behind a moving cloud is another thing. */
	scene.camera.azimuth_deg = 320;
	scene.camera.elevation_deg = 35;
	scene.radiosity.enabled = false;
	return scene;
}

static int compare_floats(const void *a, const void *b)
{
	const float x = *(const float *)a, y = *(const float *)b;
	return (x > y) - (x < y);
}

/* Mean of the frame, and the 99.9th percentile of the changes of its pixels' luminance since the frame before. */
static void measure(const struct frame *frame, float *before, bool first, double *mean, double *change)
{
	static float changes[PIXELS];
	*mean = 0;
	for (int i = 0; i < PIXELS; i++) {
		const float now = (float)luminance_of(frame, LAYER_COLOR, i % SIDE_X, i / SIDE_X);
		*mean += (double)now / PIXELS;
		changes[i] = first ? 0 : fabsf(now - before[i]);
		before[i] = now;
	}
	qsort(changes, PIXELS, sizeof *changes, compare_floats);
	*change = changes[PIXELS - PIXELS / 1000 - 1];
}

static void check_frames(enum cloud_type type, double start)
{
	static float before[PIXELS];
	double change[FRAMES], sorted[FRAMES - 1], last_mean = 0, largest_mean = 0;
	float order[FRAMES - 1];
	for (int i = 0; i < FRAMES; i++) {
		const struct scene scene = moving_scene(type, start + i / frames_per_second);
		struct frame frame = render(&scene);
		double mean;
		measure(&frame, before, i == 0, &mean, &change[i]);
		frame_finish(&frame);
		if (i > 0) {
			largest_mean = fmax(largest_mean, fabs(mean / last_mean - 1));
			order[i - 1] = (float)change[i];
		}
		last_mean = mean;
	}
	qsort(order, FRAMES - 1, sizeof *order, compare_floats);
	for (int i = 0; i < FRAMES - 1; i++)
		sorted[i] = order[i];
	const double median = sorted[FRAMES / 2 - 1], largest = sorted[FRAMES - 2];
	print_message("%s from %.2f s: mean changes by %.4f%% at most, 99.9th percentile %.2f times its median\n",
		      scene_cloud_type_names[type], start, 100 * largest_mean, largest / median);
	assert_true(largest_mean < 0.01);
	assert_true(median > 0);
	assert_true(largest < 3 * median);
}

/* Starts: of all, and so that the frames cross the end of the whole way over the tile. Lives end all the time. */
static void check_type(enum cloud_type type)
{
	static const double starts[] = {0, 1e5 - 1, 9.9e6};
	for (size_t i = 0; i < sizeof starts / sizeof *starts; i++)
		check_frames(type, starts[i]);
}

static void stratus_moves_smoothly(void **state)
{
	(void)state;
	check_type(CLOUD_STRATUS);
}

static void stratocumulus_moves_smoothly(void **state)
{
	(void)state;
	check_type(CLOUD_STRATOCUMULUS);
}

static void altocumulus_moves_smoothly(void **state)
{
	(void)state;
	check_type(CLOUD_ALTOCUMULUS);
}

static void cirrocumulus_moves_smoothly(void **state)
{
	(void)state;
	check_type(CLOUD_CIRROCUMULUS);
}

/* --- lives ------------------------------------------------------------------------------------------------------------------------- */

enum { MAP = 128 };

/* Thickness seen from straight below, over the part of the layer that drifts with the wind. */
static void look_up(const struct scene *still, double time, float *thickness)
{
	struct scene scene = *still;
	scene.clouds.time_s = time;
	for (int i = 0; i < 2; i++)
		scene.camera.position_m[i] = fmod(scene.clouds.wind_mps[i] * time, scene.clouds.tile_m);
	struct frame frame = render(&scene);
	for (int i = 0; i < MAP * MAP; i++)
		thickness[i] = pixel_of(&frame, LAYER_OPTICAL_THICKNESS, i % MAP, i / MAP)[0];
	frame_finish(&frame);
}

static double correlation(const float *a, const float *b)
{
	double sum[5] = {0};
	for (int i = 0; i < MAP * MAP; i++) {
		sum[0] += a[i];
		sum[1] += b[i];
		sum[2] += (double)a[i] * a[i];
		sum[3] += (double)b[i] * b[i];
		sum[4] += (double)a[i] * b[i];
	}
	const double n = MAP * MAP;
	return (n * sum[4] - sum[0] * sum[1]) / sqrt((n * sum[2] - sum[0] * sum[0]) * (n * sum[3] - sum[1] * sum[1]));
}

/* Moving with the wind: the same cloud after seconds, whichever way the wind blows; changed after minutes; another sky after hours. */
static void clouds_move_with_the_wind_live_and_die(void **state)
{
	(void)state;
	static float first[MAP * MAP], later[MAP * MAP];
	struct scene scene = small_scene(MAP, MAP, LAYER(OPTICAL_THICKNESS));
	scene.clouds.wind_mps[0] = -11;
	scene.clouds.wind_mps[1] = 6;
	scene.camera.elevation_deg = 90;
	scene.camera.vertical_fov_deg = 130;
	scene.radiosity.enabled = false;
	for (int i = 0; i < 2; i++) {
		const double start = i == 0 ? 500 : 9.5e6;
		look_up(&scene, start, first);
		look_up(&scene, start + 20, later);
		const double soon = correlation(first, later);
		look_up(&scene, start + 600, later);
		const double minutes = correlation(first, later);
		look_up(&scene, start + 20000, later);
		const double hours = correlation(first, later);
		print_message("correlation after 20 s %.3f, 10 min %.3f, 5.6 h %.3f\n", soon, minutes, hours);
		assert_true(soon > 0.98);
		assert_true(minutes > 0.3 && minutes < 0.95);
		assert_true(fabs(hours) < 0.35);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(stratus_moves_smoothly),
		cmocka_unit_test(stratocumulus_moves_smoothly),
		cmocka_unit_test(altocumulus_moves_smoothly),
		cmocka_unit_test(cirrocumulus_moves_smoothly),
		cmocka_unit_test(clouds_move_with_the_wind_live_and_die),
	};
	return RUN_WITH_RENDERER(tests);
}
