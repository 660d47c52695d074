/* A uniform deck over Lambertian ground in whole pictures: against the solver with a reflecting ground, discrete ordinates
 * (tests/data/ground.json), and the balance of all light. And what is left of a sky's light where clouds end. Skipped where no OpenGL
 * context comes up. */
#include "tests/validate/deck.h"

#include "renderer/log.h"
#include "renderer/scene_map.h"
#include "tests/unit/numbers.h"

#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

static struct kernel *kernel;
static struct deck *deck;

static double worst_of(const double found[BAND_COUNT], const double wanted[BAND_COUNT])
{
	double worst = 0;
	for (int band = 0; band < BAND_COUNT; band++)
		worst = fmax(worst, fabs(found[band] / wanted[band] - 1));
	return worst;
}

static void deck_against_the_solver(void **state)
{
	(void)state;
	static const double taus[] = {1, 5, 20, 50}, zeniths[] = {0, 40, 75}, albedos[] = {0.05, 0.4, 0.85, 1};
	for (size_t t = 0; t < sizeof taus / sizeof *taus; t++)
		for (size_t z = 0; z < sizeof zeniths / sizeof *zeniths; z++)
			for (size_t a = 0; a < sizeof albedos / sizeof *albedos; a++) {
				const struct scene scene = deck_scene(deck, taus[t], zeniths[z], albedos[a]);
				struct deck_light found, wanted;
				assert_true(deck_measure(deck, &scene, &found));
				deck_expect(deck, &scene, &found, &wanted);
				const double ground = worst_of(found.ground, wanted.ground);
				double base = 0;
				for (int view = 0; view < 2; view++)
					if (zeniths[z] + deck_views[view] > 10) /* else the sun is in the picture */
						base = fmax(base, worst_of(found.base[view], wanted.base[view]));
				print_message("tau %2.0f, sun zenith %2.0f, albedo %.2f: ground off by %.2f %%, base by %.2f %%\n", taus[t],
					      zeniths[z], albedos[a], 100 * ground, 100 * base);
				assert_true(ground < 0.005);
				assert_true(base < 0.005);
			}
}

/* With the radiosity off the ground has its first light, and the base gets nothing of it: as over black ground. */
static void without_radiosity_nothing_comes_back(void **state)
{
	(void)state;
	struct scene scene = deck_scene(deck, 12, 50, 0.7), black = scene;
	struct deck_light found, wanted;
	scene.radiosity.enabled = false;
	for (int band = 0; band < BAND_COUNT; band++)
		black.ground.albedo[band] = 1e-6;
	assert_true(deck_measure(deck, &scene, &found));
	deck_expect(deck, &black, &found, &wanted); /* under the sky that the bright ground makes */
	assert_true(worst_of(found.ground, wanted.ground) < 0.005);
	assert_true(worst_of(found.base[1], wanted.base[1]) < 0.005);
	scene.radiosity.enabled = true;
	assert_true(deck_measure(deck, &scene, &found));
	assert_true(worst_of(found.ground, wanted.ground) > 0.5);
}

/* The rows are for sunlight alone: the sky's part of what was measured is taken off as the solver has it. */
static void compare_row(const json_t *flux, const json_t *radiance)
{
	const double tau = element(flux, 0), zenith = element(flux, 1), albedo = element(flux, 2), mu = cos(zenith * M_PI / 180);
	const struct scene scene = deck_scene(deck, tau, zenith, albedo);
	struct deck_light found, with_sky, sun, alone;
	assert_true(deck_measure(deck, &scene, &found));
	deck_expect(deck, &scene, &found, &with_sky);
	sun = found;
	sun.sky[1] = 0;
	deck_expect(deck, &scene, &sun, &alone);
	const double beam = found.beam[1], ground = (found.ground[1] - with_sky.ground[1] + alone.ground[1]) / beam;
	print_message("tau %g, sun zenith %g, albedo %.2f: ground %.4f, discrete ordinates %.4f; base", tau, zenith, albedo, ground,
		      element(flux, 4));
	if (albedo > 0) /* else nothing is seen of it */
		assert_float_equal(ground / element(flux, 4), 1, 0.005);
	for (size_t view = 0; view < 2; view++) {
		const double base = (found.base[view][1] - with_sky.base[view][1] + alone.base[view][1]) / (beam / mu);
		print_message(" %.4f, %.4f", base, element(radiance, 3 + view));
		assert_float_equal(base / element(radiance, 3 + view), 1, 0.005);
	}
	print_message("\n");
}

static void deck_against_discrete_ordinates(void **state)
{
	(void)state;
	json_t *ground = json_load_file("tests/data/ground.json", 0, NULL);
	const json_t *rows = json_object_get(ground, "rows");
	const json_t *radiances = json_object_get(json_object_get(ground, "base_radiance_seen_from_below"), "rows");
	assert_true(json_array_size(rows) > 0);
	assert_int_equal(json_array_size(rows), json_array_size(radiances));
	for (size_t i = 0; i < json_array_size(rows); i++)
		compare_row(json_array_get(rows, i), json_array_get(radiances, i));
	json_decref(ground);
}

/* What falls on the top leaves it again or is taken by the ground. */
static void light_is_kept(void **state)
{
	(void)state;
	static const double cases[][3] = {{8, 60, 0.85}, {20, 30, 0.3}, {40, 0, 0.05}};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		const struct scene scene = deck_scene(deck, cases[i][0], cases[i][1], cases[i][2]);
		struct deck_light light;
		double leaving[BAND_COUNT];
		assert_true(deck_measure(deck, &scene, &light));
		assert_true(deck_measure_leaving(deck, &scene, leaving));
		for (int band = 0; band < BAND_COUNT; band++) {
			const double in = light.beam[band] + light.sky[band], taken = (1 - cases[i][2]) * light.ground[band];
			print_message("tau %2.0f, sun zenith %2.0f, albedo %.2f: %.4f leave, %.4f are taken, %.4f too many\n", cases[i][0],
				      cases[i][1], cases[i][2], leaving[band] / in, taken / in, (leaving[band] + taken) / in - 1);
			assert_float_equal((leaving[band] + taken) / in, 1, 0.005);
		}
	}
}

/* --- water sky --------------------------------------------------------------------------------------------------------------------- */

static struct scene coast_scene(double tau, double base_m)
{
	struct scene scene = deck_scene(deck, tau, 60, 0);
	scene.ground.type = GROUND_SEA_ICE;
	scene.clouds.base_m = base_m;
	scene.sun.azimuth_deg = 0; /* along the coast */
	return scene;
}

/* Measured under uniform stratus at Palmer Station: in the visible the sky over the island's snow is up to twice as bright as over open
 * ocean, whatever the height of the cloud. (P. Ricchiazzi, A. Payton and C. Gautier 2002, "A test of three-dimensional radiative transfer
 * simulation using the radiance signatures and contrasts at a high latitude coastal site", J. Geophys. Res. 107.) Here the coast is
 * straight, with fresh snow of albedo 0.92 down to the water, so that decks of usual thickness come out about twice, at 30 degrees of
 * elevation, and very thick ones above. */
static void snow_brightens_the_sky_about_twice(void **state)
{
	(void)state;
	static const double taus[] = {10, 20, 40}, bases[] = {400, 1000};
	double contrast[2][3];
	for (int b = 0; b < 2; b++)
		for (int t = 0; t < 3; t++) {
			const struct scene scene = coast_scene(taus[t], bases[b]);
			const double place[] = {scene.clouds.tile_m / 2, scene.clouds.tile_m / 2, 2};
			double snow, water;
			assert_true(deck_measure_luminance(deck, &scene, place, 270, 30, &snow));
			assert_true(deck_measure_luminance(deck, &scene, place, 90, 30, &water));
			contrast[b][t] = snow / water;
			print_message("tau %2.0f, base %4.0f m: the sky over snow is %.2f times as bright as over water\n", taus[t],
				      bases[b], snow / water);
			assert_true(contrast[b][t] > 1.5 && contrast[b][t] < (taus[t] > 20 ? 3.0 : 2.4));
		}
	for (int t = 0; t < 3; t++)
		assert_float_equal(contrast[0][t] / contrast[1][t], 1, 0.05);
}

/* Across the coast, straight up from below the base. A half plane's form factor is (1 + x/sqrt(h^2 + x^2))/2, which goes from 10 to 90 %
 * over 8/3 h; light that bounces several times over the snow goes farther. */
static void transition_is_as_wide_as_the_base_is_high(void **state)
{
	(void)state;
	enum { STEPS = 81 };
	for (double base = 300; base < 1000; base *= 2) {
		const struct scene scene = coast_scene(20, base);
		double light[STEPS], at[2] = {0};
		for (int i = 0; i < STEPS; i++) {
			const double x = base * (i - STEPS / 2) * 0.2, place[] = {scene.clouds.tile_m / 2 + x, 100, base - 1};
			assert_true(deck_measure_luminance(deck, &scene, place, 0, 90, &light[i]));
		}
		for (int share = 0; share < 2; share++) {
			const double level = light[STEPS - 1] + (share ? 0.1 : 0.9) * (light[0] - light[STEPS - 1]);
			int i = 1;
			while (light[i] > level)
				i++;
			at[share] = 0.2 * (i - (level - light[i]) / (light[i - 1] - light[i]));
		}
		print_message("base %3.0f m: contrast %.2f far off, from 90 to 10 %% over %.2f h\n", base, light[0] / light[STEPS - 1],
			      at[1] - at[0]);
		assert_true(at[1] - at[0] > 8 / 3.0 && at[1] - at[0] < 5);
	}
}

/* --- where clouds end -------------------------------------------------------------------------------------------------------------- */

/* Under a layer that is hardly there, the ground has the light of its clear sky: nothing is lost between the base and the ground. */
static void ground_under_nothing_has_its_clear_sky(void **state)
{
	(void)state;
	for (double elevation = 5; elevation < 90; elevation += 27)
		for (double base = 300; base < 10000; base *= 3) {
			struct scene scene = scene_default();
			struct deck_radiosity light;
			scene.sun.elevation_deg = elevation;
			scene.clouds.base_m = base;
			scene.clouds.thickness_m = 0.01;
			scene.ground.type = GROUND_BLACK;
			assert_true(deck_radiosity(deck, &scene, &light));
			for (int band = 0; band < BAND_COUNT; band++) {
				assert_float_equal(light.ground_diffuse[band] / light.sky_ground[band], 1, 0.01);
				assert_float_equal(light.ground_direct[band] / light.sun_ground[band], 1, 0.01);
			}
		}
}

/* --- grounds ----------------------------------------------------------------------------------------------------------------------- */

/* A map of patches far smaller than the base is high: all reflect the same light. */
static struct scene_map *patches_create(void)
{
	enum { SIDE = 128 };
	static const unsigned char hash[SCENE_MAP_HASH_BYTES] = {1};
	struct scene_map *map = scene_map_create(SIDE, SIDE, 3, hash);
	assert_non_null(map);
	for (int i = 0; i < 3 * SIDE * SIDE; i++)
		map->values[i] = 0.1f + 0.2f * (float)((i / 3 * 7 + i % 3 + i / (3 * SIDE)) % 4);
	scene_map_seal(map);
	return map;
}

/* What pictures show of a ground, over what the radiosity says that it receives times its mean albedo. */
static double shown_over_received(struct scene scene, enum ground_type type, const struct scene_map *map, int band)
{
	struct deck_radiosity light;
	double up[BAND_COUNT];
	scene.ground.type = type;
	scene.ground.map.map = map;
	assert_true(deck_radiosity(deck, &scene, &light));
	assert_true(deck_measure_ground(deck, &scene, 128, up));
	return up[band] / (light.ground_albedo[band] * (light.ground_diffuse[band] + light.ground_direct[band]));
}

/* Over that of an even ground, whose part is the air between. The sea mirrors its sky and is no such ground; of sea ice this deck has only
 * a coast. */
static void grounds_send_up_what_they_receive(void **state)
{
	(void)state;
	static const enum ground_type types[] = {GROUND_GRASS, GROUND_COUNTRY, GROUND_SOIL, GROUND_SAND, GROUND_SNOW};
	static const double cases[][2] = {{0.02, 30}, {0.02, 70}, {20, 50}}; /* optical thickness, zenith angle of the sun */
	struct scene_map *map = patches_create();
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		struct scene scene = deck_scene(deck, cases[i][0], cases[i][1], 0.4);
		scene.clouds.base_m = 1000;
		const double even = shown_over_received(scene, GROUND_LAMBERT, NULL, 1);
		const double patches = shown_over_received(scene, GROUND_LAMBERT, map, 1) / even;
		print_message("tau %5.2f, sun zenith %2.0f: map %.4f", cases[i][0], cases[i][1], patches);
		assert_true(even > 0.97 && even < 1);
		assert_float_equal(patches, 1, 0.01);
		for (size_t k = 0; k < sizeof types / sizeof *types; k++) {
			const double shown = shown_over_received(scene, types[k], NULL, 1) / even;
			print_message(", %s %.4f", scene_ground_type_names[types[k]], shown);
			assert_float_equal(shown, 1, 0.01);
		}
		print_message("\n");
	}
	scene_map_release(map);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(deck_against_the_solver),
		cmocka_unit_test(without_radiosity_nothing_comes_back),
		cmocka_unit_test(deck_against_discrete_ordinates),
		cmocka_unit_test(light_is_kept),
		cmocka_unit_test(snow_brightens_the_sky_about_twice),
		cmocka_unit_test(transition_is_as_wide_as_the_base_is_high),
		cmocka_unit_test(grounds_send_up_what_they_receive),
		cmocka_unit_test(ground_under_nothing_has_its_clear_sky),
	};
	const char *path = getenv("STRATUS_KERNEL");
	kernel = kernel_load(path ? path : "build/mie.kernel");
	if (!kernel)
		return 1;
	log_set_level(LOG_ERROR);
	deck = deck_create(kernel, DECK_UNIFORM);
	const int failed = deck ? cmocka_run_group_tests(tests, NULL, NULL) : 77;
	deck_destroy(deck);
	kernel_destroy(kernel);
	return failed;
}
