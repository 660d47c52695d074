/* Pictures as such: parts that add up, sane values over the whole range of scenes, memory that changes nothing, types, cancelling. */
#include "tests/unit/test_renderer_common.h"

static void parts_add_up(const struct scene *scene)
{
	struct frame frame = render(scene);
	for (int y = 0; y < frame.height; y++)
		for (int x = 0; x < frame.width; x++)
			for (int channel = 0; channel < 3; channel++) {
				double sum = 0, size = 0;
				for (int layer = LAYER_SUN_DIRECT; layer <= LAYER_AIR; layer++) {
					const double part = pixel_of(&frame, layer, x, y)[channel];
					sum += part;
					size += fabs(part);
				}
				const double whole = pixel_of(&frame, LAYER_COLOR, x, y)[channel];
				if (!(fabs(whole - sum) <= 2e-6 * size + 1e-9))
					fail_msg("pixel %d %d: parts are %g, the picture is %g", x, y, sum, whole);
			}
	frame_finish(&frame);
}

static void layers_add_up_to_color(void **state)
{
	(void)state;
	struct scene scene = small_scene(64, 48, (1u << LAYER_COUNT) - 1);
	parts_add_up(&scene);
	scene.camera.position_m[2] = 3000;
	scene.camera.elevation_deg = -15;
	parts_add_up(&scene);
	scene.clouds.type = CLOUD_NONE;
	parts_add_up(&scene);
	scene.camera.azimuth_deg = 320;
	scene.camera.elevation_deg = -20;
	scene.camera.position_m[2] = 10;
	scene.clouds.type = CLOUD_STRATUS;
	parts_add_up(&scene);
}

/* --- random scenes ----------------------------------------------------------------------------------------------------------------- */

static uint64_t random_state = 20060901;

static double uniform(double low, double high)
{
	random_state = random_state * 6364136223846793005u + 1442695040888963407u;
	return low + (high - low) * (double)(random_state >> 40) / (1 << 24);
}

static int one_of(int count)
{
	return (int)uniform(0, count - 1e-6);
}

/* Numbers that span decades, evenly in their logarithm. */
static double spread(double low, double high)
{
	return exp(uniform(log(low), log(high)));
}

/* Half of the pictures are panoramas. */
static void choose_projection(struct scene *scene)
{
	scene->camera.projection = one_of(2) ? PROJECTION_PERSPECTIVE : (enum projection)one_of(PROJECTION_COUNT);
	if (scene->camera.projection == PROJECTION_CUBEMAP)
		scene->camera.face = (enum cube_face)one_of(FACE_COUNT);
	const struct scene_shape shape = scene_camera_shape(&scene->camera);
	if (shape.ratio[0])
		scene->output.width = 16 * shape.ratio[0], scene->output.height = 16 * shape.ratio[1];
	if (shape.ratio[0] == shape.ratio[1] && shape.ratio[0])
		scene->output.width = scene->output.height = 40;
}

static struct scene random_scene(void)
{
	static const enum cloud_type types[] = {CLOUD_STRATUS, CLOUD_STRATOCUMULUS, CLOUD_ALTOCUMULUS, CLOUD_CIRROCUMULUS, CLOUD_NONE};
	static const enum ground_type grounds[] = {GROUND_GRASS,   GROUND_COUNTRY, GROUND_SOIL,  GROUND_SAND,   GROUND_SEA,
						   GROUND_SEA_ICE, GROUND_SNOW,    GROUND_BLACK, GROUND_LAMBERT};
	struct scene scene = small_scene(64, 48, (1u << LAYER_COUNT) - 1);
	scene.sun = (struct scene_sun){.elevation_deg = uniform(-18, 90), .azimuth_deg = uniform(0, 360)};
	scene.dsd = (struct scene_dsd){spread(1, 5000), spread(1, 20), spread(1, 30)};
	scene.clouds.type = types[one_of(9) % 5];
	scene.clouds.seed = (uint32_t)uniform(0, 4294967295.0);
	scene.clouds.time_s = uniform(0, 1) < 0.5 ? 0 : spread(1, 1e7);
	scene.clouds.coverage = one_of(4) == 0 ? one_of(2) : uniform(0, 1);
	scene.clouds.base_m = spread(100, 12000);
	scene.clouds.thickness_m = one_of(8) == 0 ? 0 : spread(1, 2000);
	scene.clouds.tile_m = spread(2000, 200000);
	scene.clouds.resolution = 64 << one_of(4);
	scene.clouds.wind_mps[0] = uniform(-100, 100);
	scene.clouds.wind_mps[1] = uniform(-100, 100);
	scene.ground.type = grounds[one_of(sizeof grounds / sizeof *grounds)];
	for (int i = 0; i < 3; i++)
		scene.ground.albedo[i] = uniform(0, 1);
	scene.atmosphere = (struct scene_atmosphere){uniform(0, 2), uniform(0, 600)};
	scene.camera.position_m[0] = uniform(-1e6, 1e6);
	scene.camera.position_m[1] = uniform(-1e6, 1e6);
	scene.camera.position_m[2] = spread(0.1, 30000);
	scene.camera.azimuth_deg = uniform(0, 360);
	scene.camera.elevation_deg = one_of(4) == 0 ? 90 * (1 - 2 * one_of(2)) : uniform(-90, 90);
	scene.camera.roll_deg = uniform(-180, 180);
	scene.camera.vertical_fov_deg = spread(0.5, 150);
	scene.radiosity.enabled = one_of(4) != 0;
	scene.radiosity.tolerance = spread(1e-4, 1);
	choose_projection(&scene);
	return scene;
}

static void check_values(int number, const struct frame *frame)
{
	const float *values = frame->pixels;
	const size_t plane = (size_t)frame->width * (size_t)frame->height * 3;
	for (size_t i = 0; i < plane * (size_t)frame->layer_count; i++) {
		const enum layer layer = frame->layer[i / plane];
		/* Colours outside of Rec.709 have negative channels; luminances, and what is not a colour, have not. */
		const float *rgb = values + i - i % 3;
		const double value = layer <= LAYER_AIR ? 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2] : values[i];
		if (!isfinite(values[i]) || value < -1e-9 || (layer == LAYER_TRANSMITTANCE && value > 1 + 1e-6))
			fail_msg("scene %d, %s: %g (luminance %g)", number, scene_layer_names[layer], (double)values[i], value);
	}
	assert_true(isfinite(frame->exposure_ev) && isfinite(frame->radiosity_residual));
	assert_true(frame->direct_illuminance_lux >= 0 && frame->diffuse_illuminance_lux >= 0);
	assert_true(frame->global_illuminance_lux < 200000);
}

/* A picture of one kind of light alone is that layer of the whole picture; of all but one, the difference. */
static void paths_are_layers(void **state)
{
	(void)state;
	struct scene scene = small_scene(64, 48, (1u << LAYER_COUNT) - 1);
	scene.clouds.coverage = 0.6;
	struct frame whole = render(&scene);
	for (int layer = LAYER_SUN_DIRECT; layer <= LAYER_AIR; layer++) {
		const uint32_t path = 1u << (layer - LAYER_SUN_DIRECT);
		scene.output.layers = LAYER(COLOR);
		scene.model.paths = path;
		struct frame alone = render(&scene);
		scene.output.layers = LAYER(COLOR) | 1u << layer;
		scene.model.paths = SCENE_PATHS_ALL & ~path;
		struct frame without = render(&scene);
		for (int y = 0; y < 48; y++)
			for (int x = 0; x < 64; x++)
				for (int c = 0; c < 3; c++) {
					const double all = pixel_of(&whole, LAYER_COLOR, x, y)[c];
					const double part = pixel_of(&whole, (enum layer)layer, x, y)[c];
					assert_float_equal(pixel_of(&alone, LAYER_COLOR, x, y)[c], part, 1e-4 * fabs(part) + 1e-6);
					assert_float_equal(pixel_of(&without, LAYER_COLOR, x, y)[c], all - part,
							   1e-5 * (fabs(all) + fabs(part)));
					assert_true(pixel_of(&without, (enum layer)layer, x, y)[c] == 0);
				}
		assert_true(alone.exposure_ev == whole.exposure_ev && alone.global_illuminance_lux == whole.global_illuminance_lux);
		frame_finish(&without);
		frame_finish(&alone);
	}
	frame_finish(&whole);
}

static void random_scenes_are_sane(void **state)
{
	(void)state;
	/* With sanitizers a scene takes seconds, and what they look for does not hide in a few of many scenes. */
#ifdef __SANITIZE_ADDRESS__
	enum { SCENES = 25 };
#else
	enum { SCENES = 200 };
#endif
	enum { SCENES_OF_A_CLOUD = 8 }; /* droplets cost more to solve than so small a picture to draw */
	struct scene_dsd dsd = {0};
	for (int i = 0; i < SCENES; i++) {
		struct scene scene = random_scene();
		if (i % SCENES_OF_A_CLOUD == 0)
			dsd = scene.dsd;
		scene.dsd = dsd;
		struct frame frame = render(&scene);
		check_values(i, &frame);
		frame_finish(&frame);
		/* By programs of its own. */
		scene.output.layers = LAYER(COLOR);
		frame = render(&scene);
		check_values(i, &frame);
		frame_finish(&frame);
	}
}

/* --- memory ------------------------------------------------------------------------------------------------------------------------ */

static void assert_same_bytes(const struct frame *a, const struct frame *b)
{
	assert_int_equal(a->bytes, b->bytes);
	assert_memory_equal(a->pixels, b->pixels, a->bytes);
}

/* Some scenes that share some stages and not others. */
static struct scene variant(int i)
{
	struct scene scene = small_scene(64, 48, LAYER(COLOR) | LAYER(ORDER1) | LAYER(GROUND));
	scene.clouds.resolution = 64;
	scene.clouds.coverage = i & 1 ? 0.4 : 0.9;
	scene.camera.position_m[2] = i & 2 ? 2500 : 2;
	scene.camera.elevation_deg = i & 2 ? -20 : 20;
	scene.sun.elevation_deg = i & 4 ? 8 : 50;
	return scene;
}

enum { VARIANTS = 8 };

static void memory_changes_nothing(void **state)
{
	(void)state;
	struct frame first[VARIANTS];
	for (int i = 0; i < VARIANTS; i++) {
		const struct scene scene = variant(i);
		first[i] = render(&scene);
	}
	for (int i = VARIANTS - 1; i >= 0; i--) {
		const struct scene scene = variant(i);
		struct frame again = render(&scene);
		assert_same_bytes(&first[i], &again);
		assert_true(again.timing[STAGE_VIEW].reused && again.timing[STAGE_RADIOSITY].reused && again.timing[STAGE_SKY].reused);
		frame_finish(&again);
	}
	/* With next to no memory, each frame evicts what the one before left. */
	renderer_destroy(renderer);
	renderer = create_renderer(1);
	assert_non_null(renderer);
	for (int i = 0; i < VARIANTS; i++) {
		const struct scene scene = variant(i * 3 % VARIANTS);
		struct frame again = render(&scene);
		assert_same_bytes(&first[i * 3 % VARIANTS], &again);
		assert_false(again.timing[STAGE_VIEW].reused || again.timing[STAGE_FIELD].reused);
		frame_finish(&again);
	}
	renderer_destroy(renderer);
	renderer = create_renderer(0);
	assert_non_null(renderer);
	for (int i = 0; i < VARIANTS; i++)
		frame_finish(&first[i]);
}

/* --- types and cancelling ------------------------------------------------------------------------------------------------------------ */

static void types_of_pixels(void **state)
{
	(void)state;
	struct scene scene = small_scene(48, 32, LAYER(COLOR));
	scene.output.format = IMAGE_PNG;
	struct frame eight = render(&scene);
	assert_int_equal(eight.type, PIXEL_U8);
	assert_int_equal(eight.bytes, 48 * 32 * 3);
	assert_int_equal(eight.layer_count, 1);
	scene.output.bits = 16;
	struct frame sixteen = render(&scene);
	assert_int_equal(sixteen.type, PIXEL_U16);
	assert_int_equal(sixteen.bytes, 48 * 32 * 6);
	double mean = 0;
	for (size_t i = 0; i < 48 * 32 * 3; i++) {
		/* One code of noise and half a code of rounding. */
		const double code = ((const uint8_t *)eight.pixels)[i], fine = ((const uint16_t *)sixteen.pixels)[i] / 257.0;
		assert_float_equal(code, fine, 1.6);
		mean += fine / (48 * 32 * 3);
	}
	assert_in_range(mean, 60, 220);
	frame_finish(&sixteen);
	frame_finish(&eight);
}

struct countdown {
	int left, asked;
};

static bool stop_after(void *context)
{
	struct countdown *countdown = context;
	countdown->asked++;
	return countdown->left-- <= 0;
}

/* A scene of which nothing is remembered, from below or above. */
static struct scene new_scene(double height)
{
	static int made;
	struct scene scene = small_scene(32, 32, LAYER(COLOR) | LAYER(AIR));
	made++;
	scene.clouds.seed = 7700 + (unsigned)made;
	scene.clouds.resolution = 256;
	scene.sun.elevation_deg = 30 + 0.01 * made;
	scene.atmosphere.aerosol_optical_depth = 0.1 + 1e-4 * made;
	scene.camera.position_m[2] = height;
	return scene;
}

/* Between the passes of sky, field and exchange, too: wherever it is asked. What is stopped leaves nothing behind that is taken for whole.
 */
static void cancelling_stops(void **state)
{
	(void)state;
	struct frame frame;
	for (int from_above = 0; from_above < 2; from_above++) {
		const double height = from_above ? 5000 : 2;
		struct scene scene = new_scene(height);
		struct countdown never = {.left = 1000};
		assert_int_equal(renderer_render(renderer, &scene, stop_after, &never, &frame), RENDER_OK);
		frame_finish(&frame);
		assert_in_range(never.asked, 18, 100);
		for (int at = 0; at < never.asked; at++) {
			struct countdown countdown = {.left = at};
			scene = new_scene(height);
			memset(&frame, 0xff, sizeof frame);
			assert_int_equal(renderer_render(renderer, &scene, stop_after, &countdown, &frame), RENDER_CANCELLED);
			assert_null(frame.pixels);
			assert_int_equal(frame.bytes, 0);
			assert_in_range(countdown.asked, at + 1, at + 2);
		}
	}
	/* Always the same scene: what was done in vain is gone or whole. */
	struct scene scene = new_scene(2);
	for (int at = 0; at < 18; at++) {
		struct countdown countdown = {.left = at};
		if (renderer_render(renderer, &scene, stop_after, &countdown, &frame) == RENDER_OK)
			frame_finish(&frame);
	}
	struct countdown last = {.left = 1000};
	assert_int_equal(renderer_render(renderer, &scene, stop_after, &last, &frame), RENDER_OK);
	struct frame clean = render(&scene);
	assert_same_bytes(&clean, &frame);
	frame_finish(&clean);
	frame_finish(&frame);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(layers_add_up_to_color), cmocka_unit_test(random_scenes_are_sane), cmocka_unit_test(paths_are_layers),
		cmocka_unit_test(memory_changes_nothing), cmocka_unit_test(types_of_pixels),        cmocka_unit_test(cancelling_stops),
	};
	return RUN_WITH_RENDERER(tests);
}
