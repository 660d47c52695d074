/* Ridges of cloud seen from below, solved against the reference model: where a slab would light both flanks of a ridge alike, the one
 * towards the sun is bright. */
#include "test_renderer_common.h"

#include "renderer/scene_map.h"

enum { SIDE = 64, RIDGES = 5, WIDTH = 48, HEIGHT = 12, SAMPLES = 128 };

/* Ridges from south to north over a tile of 8 km, with gaps as wide as they are. */
static const struct scene_map *ridges(void)
{
	static const unsigned char hash[SCENE_MAP_HASH_BYTES] = {1};
	struct scene_map *map = scene_map_create(SIDE, SIDE, 1, hash);
	assert_non_null(map);
	for (int i = 0; i < SIDE * SIDE; i++)
		map->values[i] = (float)fmax(0, sin(2 * M_PI * RIDGES * (i % SIDE + 0.5) / SIDE));
	scene_map_seal(map);
	return map;
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

static void ridges_are_lit_as_light_paths_say(void **state)
{
	(void)state;
	const struct scene_map *map = ridges();
	static const double suns[][2] = {{90, 60}, {90, 35}, {270, 35}};
	for (size_t i = 0; i < sizeof suns / sizeof *suns; i++) {
		struct scene scene = small_scene(WIDTH, HEIGHT, LAYER(COLOR));
		double solved[WIDTH], truth[WIDTH], squares = 0, bias = 0, mean = 0;
		scene.clouds.map.map = map;
		scene.clouds.tile_m = 8000;
		scene.clouds.resolution = 256;
		scene.clouds.base_m = 1000;
		scene.clouds.thickness_m = 400;
		scene.sun.azimuth_deg = suns[i][0];
		scene.sun.elevation_deg = suns[i][1];
		/* Straight up, north above: columns run along the ridges, and see two of them; no sun in the picture. */
		scene.camera.azimuth_deg = 0;
		scene.camera.elevation_deg = 90;
		scene.camera.position_m[0] = 800;
		scene.camera.vertical_fov_deg = 28;
		columns_of(&scene, solved);
		scene.model.name = MODEL_REFERENCE;
		scene.model.samples = SAMPLES;
		columns_of(&scene, truth);
		for (int x = 0; x < WIDTH; x++) {
			squares += (solved[x] - truth[x]) * (solved[x] - truth[x]) / WIDTH;
			bias += (solved[x] - truth[x]) / WIDTH;
			mean += truth[x] / WIDTH;
		}
		/* Of the ridge that lies west of the camera, the flanks east (26) and west (38). */
		const bool east = suns[i][0] < 180;
		const double lit = solved[east ? 26 : 38] / solved[east ? 38 : 26], wanted = truth[east ? 26 : 38] / truth[east ? 38 : 26];
		print_message("sun in azimuth %.0f, %.0f degrees high: solved against reference, bias %+.1f %%, rms %.1f %%; lit over dark "
			      "flank %.2f, %.2f\n",
			      suns[i][0], suns[i][1], 100 * bias / mean, 100 * sqrt(squares) / mean, lit, wanted);
		assert_true(fabs(bias) < 0.10 * mean);
		assert_true(sqrt(squares) < 0.38 * mean);
		assert_true(lit > 1.7); /* of columns that know nothing of each other it is 1.2 to 1.4 */
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(ridges_are_lit_as_light_paths_say)};
	return RUN_WITH_RENDERER(tests);
}
