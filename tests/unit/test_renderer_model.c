/* The reference model as scenes ask for it: parts that add up, seeds, ends by time and by cancelling. */
#include "renderer/gl/timer.h"
#include "renderer/scene_map.h"
#include "tests/unit/test_renderer_common.h"

enum { WIDTH = 24, HEIGHT = 18, PIXELS = WIDTH * HEIGHT };

static struct scene reference_scene(int samples, uint32_t layers)
{
	struct scene scene = small_scene(WIDTH, HEIGHT, layers);
	scene.model.name = MODEL_REFERENCE;
	scene.model.samples = samples;
	scene.clouds.resolution = 128;
	scene.camera.elevation_deg = 25;
	return scene;
}

static double mean_luminance(const struct frame *frame, enum layer layer)
{
	double sum = 0;
	for (int y = 0; y < HEIGHT; y++)
		for (int x = 0; x < WIDTH; x++)
			sum += luminance_of(frame, layer, x, y) / PIXELS;
	return sum;
}

static void assert_same(const struct frame *a, const struct frame *b)
{
	assert_int_equal(a->bytes, b->bytes);
	assert_memory_equal(a->pixels, b->pixels, a->bytes);
}

static void parts_add_up(void **state)
{
	(void)state;
	for (int above = 0; above < 2; above++) {
		struct scene scene = reference_scene(6, (1u << (LAYER_AIR + 1)) - 1);
		scene.camera.position_m[2] = above ? 3000 : 2;
		scene.camera.elevation_deg = above ? -20 : 5; /* some ground, some sky */
		struct frame frame = render(&scene);
		assert_int_equal(frame.samples, 6);
		for (int y = 0; y < HEIGHT; y++)
			for (int x = 0; x < WIDTH; x++)
				for (int c = 0; c < 3; c++) {
					double sum = 0;
					for (int i = LAYER_SUN_DIRECT; i <= LAYER_AIR; i++)
						sum += pixel_of(&frame, (enum layer)i, x, y)[c];
					const double color = pixel_of(&frame, LAYER_COLOR, x, y)[c];
					assert_true(fabs(sum - color) < 1e-3 * fabs(color) + 1e-4);
				}
		for (int i = LAYER_ORDER1; i <= LAYER_GROUND; i++)
			assert_true(mean_luminance(&frame, (enum layer)i) > 0 || (above && i == LAYER_SKY) || i == LAYER_SKY);
		frame_finish(&frame);
	}
}

/* A step over the base changes nothing of an even layer overhead, nor one under the tops of what lies below. */
static void the_inside_follows_from_the_outside(void **state)
{
	static const unsigned char hash[SCENE_MAP_HASH_BYTES] = {3};
	struct scene_map *map = scene_map_create(8, 8, 1, hash);
	(void)state;
	assert_non_null(map);
	for (int i = 0; i < 64; i++)
		map->values[i] = 1;
	scene_map_seal(map);
	for (int above = 0; above < 2; above++) {
		double means[2] = {0}; /* of blue, which air adds most to */
		for (int inside = 0; inside < 2; inside++) {
			struct scene scene = reference_scene(48, LAYER(COLOR));
			scene.clouds.map.map = map;
			scene.clouds.base_m = 1200;
			scene.clouds.thickness_m = 150;
			scene.camera.position_m[2] = above ? (inside ? 1349.8 : 1350.2) : inside ? 1200.1 : 1199.9;
			scene.camera.elevation_deg = above ? -60 : 60;
			scene.camera.azimuth_deg = scene.sun.azimuth_deg + 180;
			struct frame frame = render(&scene);
			for (int i = 0; i < PIXELS; i++)
				means[inside] += pixel_of(&frame, LAYER_COLOR, i % WIDTH, i / WIDTH)[2] / PIXELS;
			frame_finish(&frame);
		}
		print_message("%s, outside and inside: %.3f, %.3f\n", above ? "down" : "up", means[0], means[1]);
		assert_true(fabs(means[1] - means[0]) < 0.03 * means[0]);
	}
}

static void seeds_make_the_picture(void **state)
{
	(void)state;
	struct scene scene = reference_scene(5, LAYER(COLOR));
	struct frame first = render(&scene), again = render(&scene);
	scene.model.seed = 7;
	struct frame other = render(&scene);
	assert_same(&first, &again);
	assert_memory_not_equal(first.pixels, other.pixels, first.bytes);
	frame_finish(&first);
	frame_finish(&again);
	frame_finish(&other);
}

static int by_size(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* The standard error says by how much pictures of other seeds differ, and falls as the root of the samples: that of most pixels, since the
 * few with paths that are rare and bright only know theirs when one has come. Such a path is in the scatter and in the error of its own
 * picture, so that both pictures' errors are asked. */
static void standard_error_is_the_scatter(void **state)
{
	(void)state;
	static const struct {
		int samples;
		uint32_t seed;
	} pictures[3] = {{64, 1}, {256, 1}, {256, 3}};
	struct frame frames[3];
	double error[3] = {0}, median[3], scatter = 0;
	for (int i = 0; i < 3; i++) {
		struct scene scene = reference_scene(pictures[i].samples, LAYER(COLOR) | LAYER(STANDARD_ERROR));
		scene.model.seed = pictures[i].seed;
		frames[i] = render(&scene);
		double errors[PIXELS];
		for (int k = 0; k < PIXELS; k++) {
			errors[k] = pixel_of(&frames[i], LAYER_STANDARD_ERROR, k % WIDTH, k / WIDTH)[1];
			error[i] += pow(errors[k], 2) / PIXELS;
		}
		qsort(errors, PIXELS, sizeof *errors, by_size);
		median[i] = errors[PIXELS / 2];
	}
	for (int k = 0; k < PIXELS; k++)
		scatter += pow(pixel_of(&frames[1], LAYER_COLOR, k % WIDTH, k / WIDTH)[1] -
				       pixel_of(&frames[2], LAYER_COLOR, k % WIDTH, k / WIDTH)[1],
			       2) /
			   (2 * PIXELS);
	for (int i = 0; i < 3; i++)
		frame_finish(&frames[i]);
	const double both = 0.5 * (error[1] + error[2]);
	print_message("standard error, rms %.3f, %.3f, median %.3f, %.3f; scatter %.3f\n", sqrt(error[0]), sqrt(both), median[0], median[1],
		      sqrt(scatter));
	assert_true(median[0] / median[1] > 1.5 && median[0] / median[1] < 2.7);
	assert_true(sqrt(scatter / both) > 0.7 && sqrt(scatter / both) < 1.3);
}

/* Behind a layer the sun's disc is no matter of chance: it is the slab's, in all samples. */
static void disc_is_that_of_the_slab(void **state)
{
	(void)state;
	struct scene scene = reference_scene(3, LAYER(SUN_DIRECT));
	struct frame reference = render(&scene);
	scene.model.name = MODEL_SLAB;
	struct frame slab = render(&scene);
	const double expected = mean_luminance(&slab, LAYER_SUN_DIRECT);
	print_message("mean luminance of the disc %.2f, of the slab's %.2f\n", mean_luminance(&reference, LAYER_SUN_DIRECT), expected);
	assert_true(expected > 1);
	assert_true(fabs(mean_luminance(&reference, LAYER_SUN_DIRECT) / expected - 1) < 1e-3);
	frame_finish(&reference);
	frame_finish(&slab);
}

/* Asked so many times it says no. */
static bool is_impatient(void *context)
{
	int *patience = context;
	return --*patience < 0;
}

static void cancelling_leaves_what_there_is(void **state)
{
	(void)state;
	struct scene scene = reference_scene(4096, LAYER(COLOR));
	for (int partial = 0; partial < 2; partial++) {
		struct frame frame;
		int patience = 60;
		scene.model.partial = partial;
		const enum render_result result = renderer_render(renderer, &scene, is_impatient, &patience, &frame);
		assert_int_equal(result, partial ? RENDER_OK : RENDER_CANCELLED);
		if (partial) {
			assert_true(frame.partial && frame.samples > 0 && frame.samples < 4096);
			assert_true(mean_luminance(&frame, LAYER_COLOR) > 0.1);
		}
		frame_finish(&frame);
	}
	/* Before there is a picture there is none to answer. */
	struct frame frame;
	int patience = 0;
	assert_int_equal(renderer_render(renderer, &scene, is_impatient, &patience, &frame), RENDER_CANCELLED);
}

static void time_ends_the_paths(void **state)
{
	(void)state;
	struct scene scene = reference_scene(65536, LAYER(COLOR));
	scene.model.time_budget_ms = 300;
	const double begin = clock_milliseconds();
	struct frame frame = render(&scene);
	const double took = clock_milliseconds() - begin;
	print_message("%d samples in %.0f ms\n", frame.samples, took);
	assert_true(frame.samples > 0 && frame.samples < 65536 && !frame.partial);
	assert_true(took < 30000);
	frame_finish(&frame);
}

static void clear_skies_have_no_error(void **state)
{
	(void)state;
	struct scene scene = reference_scene(4, LAYER(COLOR) | LAYER(STANDARD_ERROR));
	scene.clouds.type = CLOUD_NONE;
	struct frame reference = render(&scene);
	scene.model.name = MODEL_SLAB;
	scene.output.layers = LAYER(COLOR);
	struct frame slab = render(&scene);
	assert_true(mean_luminance(&reference, LAYER_STANDARD_ERROR) == 0);
	assert_true(fabs(mean_luminance(&reference, LAYER_COLOR) / mean_luminance(&slab, LAYER_COLOR) - 1) < 1e-3);
	frame_finish(&reference);
	frame_finish(&slab);
}

/* Paths through an empty layer bring what there is without one. */
static void empty_layers_are_clear_skies(void **state)
{
	(void)state;
	for (int low = 0; low < 2; low++) {
		struct scene scene = reference_scene(64, LAYER(COLOR));
		scene.clouds.coverage = 0;
		scene.camera.elevation_deg = 5; /* sky and ground */
		scene.sun.elevation_deg = low ? 4 : 40;
		struct frame traced = render(&scene);
		scene.model.name = MODEL_SLAB;
		struct frame solved = render(&scene);
		for (int half = 0; half < 2; half++) {
			double a = 0, b = 0;
			for (int y = half * HEIGHT / 2; y < (half + 1) * HEIGHT / 2; y++)
				for (int x = 0; x < WIDTH; x++) {
					a += luminance_of(&traced, LAYER_COLOR, x, y);
					b += luminance_of(&solved, LAYER_COLOR, x, y);
				}
			print_message("sun at %.0f degrees, half %d: %.4f\n", scene.sun.elevation_deg, half, a / b);
			assert_true(a / b > 0.985 && a / b < 1.015);
		}
		frame_finish(&traced);
		frame_finish(&solved);
	}
}

/* Each kind has a program of its own in the reference. */
static void grounds_are_those_of_the_slab(void **state)
{
	(void)state;
	for (int ground = 0; ground <= GROUND_SNOW; ground++) {
		struct scene scene = reference_scene(64, LAYER(COLOR));
		scene.clouds.type = CLOUD_STRATUS;
		scene.clouds.coverage = 1;
		scene.ground.type = (enum ground_type)ground;
		scene.camera.position_m[2] = 300;
		scene.camera.elevation_deg = -35;
		struct frame traced = render(&scene);
		scene.model.name = MODEL_SLAB;
		struct frame solved = render(&scene);
		const double ratio = mean_luminance(&traced, LAYER_COLOR) / mean_luminance(&solved, LAYER_COLOR);
		print_message("ground %d: %.3f\n", ground, ratio);
		assert_true(ratio > 0.85 && ratio < 1.15);
		frame_finish(&traced);
		frame_finish(&solved);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(parts_add_up),
		cmocka_unit_test(the_inside_follows_from_the_outside),
		cmocka_unit_test(seeds_make_the_picture),
		cmocka_unit_test(standard_error_is_the_scatter),
		cmocka_unit_test(disc_is_that_of_the_slab),
		cmocka_unit_test(cancelling_leaves_what_there_is),
		cmocka_unit_test(time_ends_the_paths),
		cmocka_unit_test(grounds_are_those_of_the_slab),
		cmocka_unit_test(clear_skies_have_no_error),
		cmocka_unit_test(empty_layers_are_clear_skies),
	};
	return RUN_WITH_RENDERER(tests);
}
