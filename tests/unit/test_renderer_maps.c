/* Pictures whose clouds or ground are maps: what lies where, how thick, how bright; and that nothing is remembered under a wrong name. */
#include "test_renderer_common.h"

#include "renderer/scene_map.h"

enum { SIDE = 8, PICTURE = 32 };

/* All maps, of the whole program. */
static const struct scene_map *made[256];
static int made_count;

/* Each is another content. Lives to the end of the program. */
static const struct scene_map *map_of(int width, int height, int channels, const float *values)
{
	unsigned char next[SCENE_MAP_HASH_BYTES] = {(unsigned char)(made_count + 1)};
	struct scene_map *map = scene_map_create(width, height, channels, next);
	assert_non_null(map);
	memcpy(map->values, values, (size_t)width * (size_t)height * (size_t)channels * sizeof *values);
	scene_map_seal(map);
	made[made_count++] = map;
	return map;
}

/* One value everywhere but in the north-west corner, SIDE x SIDE, one or three channels. */
static const struct scene_map *corner_map(int channels, float elsewhere, float corner)
{
	float values[SIDE * SIDE * 3];
	for (int i = 0; i < SIDE * SIDE * channels; i++)
		values[i] = i < channels ? corner : elsewhere;
	return map_of(SIDE, SIDE, channels, values);
}

static const struct scene_map *even_map(int channels, float value)
{
	return corner_map(channels, value, value);
}

static struct scene scene_with(const struct scene_map *clouds, const struct scene_map *ground, uint32_t layers)
{
	struct scene scene = small_scene(PICTURE, PICTURE, layers);
	scene.clouds.map.map = clouds;
	scene.clouds.tile_m = 16000; /* texels of the maps here: 2 km */
	scene.clouds.resolution = 256;
	if (ground) {
		scene.ground.map.map = ground;
		scene.ground.type = GROUND_LAMBERT;
	}
	return scene;
}

/* Mean of a layer's first component straight up from, or straight down to, a place. */
static double straight(struct scene scene, enum layer layer, double east_m, double north_m, double height_m, double elevation_deg)
{
	scene.camera.position_m[0] = east_m;
	scene.camera.position_m[1] = north_m;
	scene.camera.position_m[2] = height_m;
	scene.camera.elevation_deg = elevation_deg;
	scene.camera.vertical_fov_deg = 2;
	struct frame frame = render(&scene);
	double sum = 0;
	for (int i = 0; i < PICTURE * PICTURE; i++)
		sum += pixel_of(&frame, layer, i % PICTURE, i / PICTURE)[0];
	frame_finish(&frame);
	return sum / (PICTURE * PICTURE);
}

/* The centre of the texel in a column from the west and a row from the north, with the tile's corner at the origin. */
static void texel_centre(int column, int row, double *east_m, double *north_m)
{
	*east_m = (column + 0.5) * 2000;
	*north_m = 16000 - (row + 0.5) * 2000;
}

/* Optical thickness over thickness (full phase function, 550 nm), from a map that is one everywhere. */
static double extinction(void)
{
	const struct scene scene = scene_with(even_map(1, 1), NULL, LAYER(OPTICAL_THICKNESS));
	return straight(scene, LAYER_OPTICAL_THICKNESS, 0, 0, 2, 90) / scene.clouds.thickness_m;
}

static void test_thickness_is_map_times_thickness(void **state)
{
	(void)state;
	const double kappa = extinction();
	/* 4 pi/2 of the droplets' cross section: N0 2 pi <r^2>; 7 um, gamma 2: <r^2> = gamma (gamma + 1) rn^2. */
	const double rn = 7e-6 / 4, geometric = 2 * M_PI * 300e6 * 2 * 3 * rn * rn;
	assert_float_equal(kappa, geometric, 0.1 * geometric);
	static const float values[] = {0, 0.03f, 0.25f, 0.5f, 1};
	for (size_t i = 0; i < sizeof values / sizeof *values; i++)
		for (int above = 0; above < 2; above++) {
			struct scene scene = scene_with(even_map(1, values[i]), NULL, LAYER(OPTICAL_THICKNESS));
			scene.clouds.thickness_m = 300;
			scene.clouds.coverage = 0.1; /* says nothing here */
			const double tau = straight(scene, LAYER_OPTICAL_THICKNESS, 1234, -777, above ? 4000 : 2, above ? -90 : 90);
			assert_float_equal(tau, values[i] * 300 * kappa, 2e-3 * 300 * kappa);
		}
}

/* The first row is the north, the first column the west, seen from below and from above. */
static void test_the_corner_lies_north_west(void **state)
{
	(void)state;
	const struct scene scene = scene_with(corner_map(1, 0.1f, 1), NULL, LAYER(OPTICAL_THICKNESS));
	for (int above = 0; above < 2; above++)
		for (int row = 0; row < SIDE; row += SIDE - 1)
			for (int column = 0; column < SIDE; column += SIDE - 1) {
				double east, north;
				texel_centre(column, row, &east, &north);
				const double tau =
					straight(scene, LAYER_OPTICAL_THICKNESS, east, north, above ? 6000 : 2, above ? -90 : 90);
				const double expected = (row == 0 && column == 0 ? 1 : 0.1) * 400 * extinction();
				assert_float_equal(tau, expected, 0.03 * expected);
			}
}

/* In a picture to the north-west of the camera the thick corner is on the left, that is west, when it looks north. */
static void test_the_corner_in_a_picture(void **state)
{
	(void)state;
	struct scene scene = scene_with(corner_map(1, 0, 1), NULL, LAYER(OPTICAL_THICKNESS));
	double east, north;
	texel_centre(0, 0, &east, &north);
	scene.camera.position_m[0] = east + 2000;
	scene.camera.position_m[1] = north - 2000;
	scene.camera.azimuth_deg = 0;
	scene.camera.elevation_deg = atan2(1200, 2000 * sqrt(2)) / DEGREE;
	scene.camera.vertical_fov_deg = 100;
	struct frame frame = render(&scene);
	double sum = 0, x = 0;
	for (int i = 0; i < PICTURE * PICTURE / 2; i++) { /* the upper half: near */
		const double tau = pixel_of(&frame, LAYER_OPTICAL_THICKNESS, i % PICTURE, i / PICTURE)[0];
		sum += tau;
		x += tau * (i % PICTURE + 0.5);
	}
	frame_finish(&frame);
	assert_true(sum > 0);
	assert_true(x / sum < 0.4 * PICTURE);
}

static void test_drift_and_regeneration(void **state)
{
	(void)state;
	struct scene scene = scene_with(corner_map(1, 0, 1), NULL, LAYER(OPTICAL_THICKNESS));
	double east, north;
	texel_centre(0, 0, &east, &north);
	const double before = straight(scene, LAYER_OPTICAL_THICKNESS, east, north, 2, 90);
	scene.clouds.time_s = 400;
	scene.clouds.wind_mps[0] = 10;
	scene.clouds.wind_mps[1] = -5;
	assert_float_equal(straight(scene, LAYER_OPTICAL_THICKNESS, east, north, 2, 90), 0, 1e-3);
	assert_float_equal(straight(scene, LAYER_OPTICAL_THICKNESS, east + 4000, north - 2000, 2, 90), before, 1e-3 * before);
}

/* Twice as wide as high: stretched over the square tile. */
static void test_stretched(void **state)
{
	(void)state;
	static const float values[] = {0, 1, 0, 0, 0, 0, 0.5f, 0};
	const struct scene scene = scene_with(map_of(4, 2, 1, values), NULL, LAYER(OPTICAL_THICKNESS));
	const double full = 400 * extinction();
	assert_float_equal(straight(scene, LAYER_OPTICAL_THICKNESS, 6000, 12000, 2, 90), full, 0.03 * full);
	assert_float_equal(straight(scene, LAYER_OPTICAL_THICKNESS, 10000, 4000, 2, 90), 0.5 * full, 0.03 * full);
	assert_float_equal(straight(scene, LAYER_OPTICAL_THICKNESS, 14000, 12000, 2, 90), 0, 0.03 * full);
}

/* Ground, of nothing else: its radiance over that of a ground of even reflectance is the ratio of the reflectances. */
static double ground_radiance(const struct scene_map *ground, double scale, double east_m, double north_m, int band)
{
	struct scene scene = scene_with(NULL, ground, LAYER(GROUND));
	scene.clouds.type = CLOUD_NONE;
	scene.ground.albedo_scale = scale;
	scene.camera.position_m[0] = east_m;
	scene.camera.position_m[1] = north_m;
	scene.camera.position_m[2] = 100;
	scene.camera.elevation_deg = -90;
	scene.camera.vertical_fov_deg = 2;
	struct frame frame = render(&scene);
	const double value = pixel_of(&frame, LAYER_GROUND, PICTURE / 2, PICTURE / 2)[band];
	frame_finish(&frame);
	return value;
}

static void test_ground_corner(void **state)
{
	(void)state;
	const struct scene_map *map = corner_map(3, 0.1f, 0.8f);
	double here[4], places[4][2];
	for (int i = 0; i < 4; i++) {
		texel_centre(i % 2 ? SIDE - 1 : 0, i / 2 ? SIDE - 1 : 0, &places[i][0], &places[i][1]);
		here[i] = ground_radiance(map, 1, places[i][0], places[i][1], 1);
	}
	assert_float_equal(here[0] / here[3], 8, 0.1);
	assert_float_equal(here[1] / here[3], 1, 0.02);
	assert_float_equal(here[2] / here[3], 1, 0.02);
}

/* A map of one colour is a Lambertian ground of that albedo: pixel by pixel, with clouds and without. */
static void test_even_ground_is_lambert(void **state)
{
	(void)state;
	static const float colour[] = {0.42f, 0.21f, 0.105f};
	for (int clouds = 0; clouds < 2; clouds++) {
		struct scene lambert = small_scene(PICTURE, PICTURE, LAYER(COLOR) | LAYER(CLOUD_GROUND));
		lambert.camera.elevation_deg = 5;
		lambert.clouds.type = clouds ? CLOUD_STRATOCUMULUS : CLOUD_NONE;
		lambert.ground.type = GROUND_LAMBERT;
		struct scene mapped = lambert;
		for (int band = 0; band < 3; band++)
			lambert.ground.albedo[band] = 2 * colour[band];
		mapped.ground.map.map = map_of(1, 1, 3, colour);
		mapped.ground.albedo_scale = 2;
		struct frame a = render(&lambert), b = render(&mapped);
		assert_float_equal(a.global_illuminance_lux, b.global_illuminance_lux, 1e-3 * a.global_illuminance_lux);
		for (int i = 0; i < PICTURE * PICTURE; i++)
			for (int band = 0; band < 3; band++) {
				const double x = pixel_of(&a, LAYER_COLOR, i % PICTURE, i / PICTURE)[band];
				assert_float_equal(pixel_of(&b, LAYER_COLOR, i % PICTURE, i / PICTURE)[band], x, 1e-3 * x);
			}
		frame_finish(&a);
		frame_finish(&b);
	}
}

/* Nearly the same radiance everywhere: an even map has no grain, whatever its resolution. */
static void test_no_detail_is_added(void **state)
{
	(void)state;
	struct scene scene = scene_with(even_map(1, 0.5f), NULL, LAYER(OPTICAL_THICKNESS));
	scene.camera.elevation_deg = 45;
	struct frame frame = render(&scene);
	const double first = pixel_of(&frame, LAYER_OPTICAL_THICKNESS, 0, 0)[0];
	for (int i = 0; i < PICTURE * PICTURE; i++)
		assert_float_equal(pixel_of(&frame, LAYER_OPTICAL_THICKNESS, i % PICTURE, i / PICTURE)[0], first, 1e-4 * first);
	frame_finish(&frame);
}

/* Only the content has changed: every stage that depends on it has, too. */
static void test_other_content_other_picture(void **state)
{
	(void)state;
	struct frame frames[3];
	for (int i = 0; i < 3; i++) {
		static const float thick[] = {0.2f, 0.8f, 0.2f};
		static const float bright[] = {0.1f, 0.1f, 0.7f};
		const struct scene scene = scene_with(even_map(1, thick[i]), even_map(3, bright[i]), LAYER(COLOR));
		frames[i] = render(&scene);
	}
	assert_true(frames[1].global_illuminance_lux < 0.7 * frames[0].global_illuminance_lux);
	assert_true(frames[2].global_illuminance_lux > 1.05 * frames[0].global_illuminance_lux);
	assert_true(luminance_of(&frames[1], LAYER_COLOR, 5, 5) < 0.8 * luminance_of(&frames[0], LAYER_COLOR, 5, 5));
	assert_true(luminance_of(&frames[2], LAYER_COLOR, 5, 5) > 1.02 * luminance_of(&frames[0], LAYER_COLOR, 5, 5));
	for (int i = 0; i < 3; i++)
		frame_finish(&frames[i]);
}

/* A map of no cloud at all is a clear sky. */
static void test_empty_map_is_clear(void **state)
{
	(void)state;
	struct scene none = small_scene(PICTURE, PICTURE, LAYER(COLOR)), empty;
	none.camera.elevation_deg = 40;
	empty = none;
	none.clouds.type = CLOUD_NONE;
	empty.clouds.map.map = even_map(1, 0);
	struct frame a = render(&none), b = render(&empty);
	for (int i = 0; i < PICTURE * PICTURE; i++) {
		const double x = luminance_of(&a, LAYER_COLOR, i % PICTURE, i / PICTURE);
		assert_float_equal(luminance_of(&b, LAYER_COLOR, i % PICTURE, i / PICTURE), x, 0.02 * x);
	}
	frame_finish(&a);
	frame_finish(&b);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_thickness_is_map_times_thickness),
		cmocka_unit_test(test_the_corner_lies_north_west),
		cmocka_unit_test(test_the_corner_in_a_picture),
		cmocka_unit_test(test_drift_and_regeneration),
		cmocka_unit_test(test_stretched),
		cmocka_unit_test(test_ground_corner),
		cmocka_unit_test(test_even_ground_is_lambert),
		cmocka_unit_test(test_no_detail_is_added),
		cmocka_unit_test(test_other_content_other_picture),
		cmocka_unit_test(test_empty_map_is_clear),
	};
	const int failed = RUN_WITH_RENDERER(tests);
	while (made_count > 0)
		scene_map_release(made[--made_count]);
	return failed;
}
