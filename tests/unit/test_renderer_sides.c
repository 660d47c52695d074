/* Ridges of cloud, solved against the reference model. Seen from below the flank towards the sun is bright, where a slab would light both
 * alike; seen from above it is so by little, since light goes sideways as far as the ridges are wide. */
#include "test_renderer_common.h"

#include "renderer/scene_map.h"

enum { SIDE = 64, WIDTH = 48, HEIGHT = 12, SAMPLES = 128 };

/* So many ridges from south to north over a tile of 8 km, from `middle` up and down by `height`, in shares of the thickness; none below 0.
 */
static const struct scene_map *ridges(int count, double middle, double height)
{
	static unsigned char hash[SCENE_MAP_HASH_BYTES];
	struct scene_map *map = scene_map_create(SIDE, SIDE, 1, (hash[0]++, hash));
	assert_non_null(map);
	for (int i = 0; i < SIDE * SIDE; i++)
		map->values[i] = (float)fmax(0, middle + height * sin(2 * M_PI * count * (i % SIDE + 0.5) / SIDE));
	scene_map_seal(map);
	return map;
}

static struct scene scene_of_ridges(const struct scene_map *map, double sun_azimuth_deg, double sun_elevation_deg)
{
	struct scene scene = small_scene(WIDTH, HEIGHT, LAYER(COLOR));
	scene.clouds.map.map = map;
	scene.clouds.tile_m = 8000;
	scene.clouds.resolution = 256;
	scene.clouds.base_m = 1000;
	scene.clouds.thickness_m = 400;
	scene.sun.azimuth_deg = sun_azimuth_deg;
	scene.sun.elevation_deg = sun_elevation_deg;
	scene.camera.azimuth_deg = 0;
	return scene;
}

/* Luminance of each column of the picture. */
static void columns_of(const struct scene *scene, double columns[WIDTH])
{
	struct frame frame = render(scene);
	for (int x = 0; x < WIDTH; x++) {
		columns[x] = 0;
		for (int y = 0; y < HEIGHT; y++)
			columns[x] += luminance_of(&frame, LAYER_COLOR, x, y) / HEIGHT;
	}
	frame_finish(&frame);
}

/* By columns, and over them all, relative to the mean truth. */
struct comparison {
	double solved[WIDTH], truth[WIDTH], bias, rms;
};

static struct comparison compare(struct scene scene)
{
	struct comparison c = {0};
	double squares = 0, mean = 0;
	columns_of(&scene, c.solved);
	scene.model.name = MODEL_REFERENCE;
	scene.model.samples = SAMPLES;
	columns_of(&scene, c.truth);
	for (int x = 0; x < WIDTH; x++) {
		squares += (c.solved[x] - c.truth[x]) * (c.solved[x] - c.truth[x]) / WIDTH;
		c.bias += (c.solved[x] - c.truth[x]) / WIDTH;
		mean += c.truth[x] / WIDTH;
	}
	c.bias /= mean;
	c.rms = sqrt(squares) / mean;
	return c;
}

static void ridges_are_lit_as_light_paths_say(void **state)
{
	(void)state;
	const struct scene_map *map = ridges(5, 0, 1); /* with gaps as wide as they are */
	static const double suns[][2] = {{90, 60}, {90, 35}, {270, 35}};
	for (size_t i = 0; i < sizeof suns / sizeof *suns; i++) {
		struct scene scene = scene_of_ridges(map, suns[i][0], suns[i][1]);
		/* Straight up, north above: columns run along the ridges, and see two of them; no sun in the picture. */
		scene.camera.elevation_deg = 90;
		scene.camera.position_m[0] = 800;
		scene.camera.vertical_fov_deg = 28;
		const struct comparison c = compare(scene);
		/* Of the ridge that lies west of the camera, the flanks east (26) and west (38). */
		const bool east = suns[i][0] < 180;
		const double lit = c.solved[east ? 26 : 38] / c.solved[east ? 38 : 26];
		print_message("from below, sun in azimuth %.0f, %.0f degrees high: solved against reference, bias %+.1f %%, rms %.1f %%; "
			      "lit over "
			      "dark flank %.2f, %.2f\n",
			      suns[i][0], suns[i][1], 100 * c.bias, 100 * c.rms, lit, c.truth[east ? 26 : 38] / c.truth[east ? 38 : 26]);
		assert_true(fabs(c.bias) < 0.10);
		assert_true(c.rms < 0.38);
		assert_true(lit > 1.7); /* of columns that know nothing of each other it is 1.2 to 1.4 */
	}
}

/* Waves of the tops, half a kilometre and a kilometre long, of a layer without gaps. */
static void tops_are_lit_as_light_paths_say(void **state)
{
	(void)state;
	static const double suns[][2] = {{90, 60}, {90, 35}, {270, 35}};
	for (int waves = 8; waves <= 16; waves *= 2) {
		const struct scene_map *map = ridges(waves, 0.75, 0.25);
		for (size_t i = 0; i < sizeof suns / sizeof *suns; i++) {
			struct scene scene = scene_of_ridges(map, suns[i][0], suns[i][1]);
			scene.camera.elevation_deg = -90;
			scene.camera.position_m[2] = 5400;
			scene.camera.vertical_fov_deg = 7;
			const struct comparison c = compare(scene);
			print_message("from above, %d waves, sun in azimuth %.0f, %.0f degrees high: bias %+.1f %%, rms %.1f %%\n", waves,
				      suns[i][0], suns[i][1], 100 * c.bias, 100 * c.rms);
			assert_true(fabs(c.bias) < 0.08);
			/* 5 to 7 and 17 to 19 %; where light came out within a tenth of the way that it does, 11 to 19 and 28 to 46 %. */
			assert_true(c.rms < (suns[i][1] > 50 ? 0.10 : 0.24));
		}
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(ridges_are_lit_as_light_paths_say),
					   cmocka_unit_test(tops_are_lit_as_light_paths_say)};
	return RUN_WITH_RENDERER(tests);
}
