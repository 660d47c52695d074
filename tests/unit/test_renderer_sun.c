/* What is seen beside the sun from below: the forward peak of an even deck falls off without a notch or a ring, and the air before gaps is
 * lit. */
#include "test_renderer_common.h"

#include "renderer/scene_map.h"

enum { SIDE = 8, WIDTH = 320, HEIGHT = 240, RINGS = 24 };

static const struct scene_map *even_map(float value)
{
	unsigned char hash[SCENE_MAP_HASH_BYTES] = {(unsigned char)(1 + 100 * value)}; /* each is another content */
	struct scene_map *map = scene_map_create(SIDE, SIDE, 1, hash);
	assert_non_null(map);
	for (int i = 0; i < SIDE * SIDE; i++)
		map->values[i] = value;
	scene_map_seal(map);
	return map;
}

static double degrees_from_sun(const struct scene *scene, int x, int y)
{
	double ray[3], sun[3];
	ray_of(scene, x, y, ray);
	direction_of(scene->sun.azimuth_deg, scene->sun.elevation_deg, sun);
	return acos(fmin(dot3(ray, sun), 1)) / DEGREE;
}

static struct scene towards_sun(double elevation_deg, double fov_deg, uint32_t layers)
{
	struct scene scene = small_scene(WIDTH, HEIGHT, layers);
	scene.sun.elevation_deg = elevation_deg;
	scene.camera.azimuth_deg = scene.sun.azimuth_deg;
	scene.camera.elevation_deg = elevation_deg;
	scene.camera.vertical_fov_deg = fov_deg;
	return scene;
}

/* Rings of a quarter of a degree round the sun, of all light but the disc's: each is darker than the one within, and even all round. */
static void an_even_deck_has_an_even_aureole(void **state)
{
	(void)state;
	static const double elevations[] = {32, 8}, thicknesses[] = {0.05, 0.3};
	for (int i = 0; i < 4; i++) {
		struct scene scene = towards_sun(elevations[i / 2], 14, LAYER(COLOR) | LAYER(SUN_DIRECT));
		const struct scene_map *map = even_map((float)thicknesses[i % 2]);
		scene.clouds.map.map = map;
		scene.clouds.thickness_m = 100;
		struct frame frame = render(&scene);
		double sum[RINGS] = {0}, least[RINGS], most[RINGS] = {0};
		int count[RINGS] = {0};
		for (int y = 0; y < HEIGHT; y++)
			for (int x = 0; x < WIDTH; x++) {
				const int ring = (int)(4 * degrees_from_sun(&scene, x, y));
				const double light = luminance_of(&frame, LAYER_COLOR, x, y) - luminance_of(&frame, LAYER_SUN_DIRECT, x, y);
				if (ring >= RINGS)
					continue;
				least[ring] = count[ring] ? fmin(least[ring], light) : light;
				most[ring] = fmax(most[ring], light);
				sum[ring] += light;
				count[ring]++;
			}
		for (int ring = 1; ring < RINGS; ring++) {
			assert_true(count[ring] > 10);
			const double inner = sum[ring - 1] / count[ring - 1], here = sum[ring] / count[ring];
			assert_true(here < 1.01 * inner);
			/* No step: over a ring it never falls by more than four fifths, and no pixel of it leaves what its neighbours span,
			 * but that ways through a deck seen low differ much between above and below the sun. */
			assert_true(here > 0.2 * inner);
			if (ring > 1 && i < 2)
				assert_true(most[ring] < 1.15 * inner && least[ring] > 0.15 * here);
		}
		print_message("sun at %g, share %g: %.3g at the disc, %.3g at 1 degree, %.3g at 5\n", elevations[i / 2], thicknesses[i % 2],
			      sum[1] / count[1], sum[4] / count[4], sum[20] / count[20]);
		frame_finish(&frame);
		scene_map_release(map);
	}
}

/* Beside the sun the air below the layer is brighter before gaps than before thick cloud, by the light of the beam; far from the sun it is
 * not. */
static void air_before_gaps_is_lit(void **state)
{
	(void)state;
	struct scene scene = towards_sun(40, 80, LAYER(AIR) | LAYER(TRANSMITTANCE));
	scene.clouds.coverage = 0.6;
	scene.clouds.seed = 8; /* gaps and thick cloud beside the sun */
	struct frame frame = render(&scene);
	double gap[2] = {0}, cloud[2] = {0};
	int gaps[2] = {0}, clouds[2] = {0};
	for (int y = 0; y < HEIGHT; y++)
		for (int x = 0; x < WIDTH; x++) {
			const double apart = degrees_from_sun(&scene, x, y);
			const double through = pixel_of(&frame, LAYER_TRANSMITTANCE, x, y)[1], air = luminance_of(&frame, LAYER_AIR, x, y);
			const int far = apart > 25;
			if ((apart > 6 && apart < 25) || apart > 30)
				continue;
			if (through > 0.99)
				gap[far] += air, gaps[far]++;
			else if (through < 0.05)
				cloud[far] += air, clouds[far]++;
		}
	assert_true(gaps[0] > 100 && clouds[0] > 100 && gaps[1] > 100 && clouds[1] > 100);
	const double near_ratio = gap[0] / gaps[0] / (cloud[0] / clouds[0]), far_ratio = gap[1] / gaps[1] / (cloud[1] / clouds[1]);
	print_message("air before gaps over that before cloud: %.2f within 6 degrees of the sun, %.2f at 25 to 30\n", near_ratio,
		      far_ratio);
	assert_true(near_ratio > 2);
	assert_true(far_ratio > 0.7 && far_ratio < 1.5);
	frame_finish(&frame);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(an_even_deck_has_an_even_aureole),
		cmocka_unit_test(air_before_gaps_is_lit),
	};
	return RUN_WITH_RENDERER(tests);
}
