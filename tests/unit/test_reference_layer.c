/* The reference model in a uniform layer, where the answer is known: against the solved slab, against single scattering in closed form, and
 * in a furnace, where everything is as bright as its surroundings. By the twin on the processor. Wants build/mie.kernel, or the file that
 * STRATUS_KERNEL names. */
#include "renderer/optics/kernel.h"
#include "tests/twin/layer.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <cmocka.h>

#define DEGREE (M_PI / 180)

enum { THREADS = 2 };

static const struct scene_dsd dsd = {300, 2, 7};
static struct droplet_tables *tables;

static double slab_at(const struct layer_case *is, int band, bool above, double mu_v, double azimuth)
{
	const double tau = is->thickness_m * tables->optics->extinction_per_m[band];
	return slab_radiance(tables->slab, tables->optics, band, above ? SLAB_REFLECTED : SLAB_TRANSMITTED, tau,
			     cos(is->sun_zenith_deg * DEGREE), mu_v, azimuth);
}

/* The slab's own error, away from its peaks, is within 1 %. */
static void layers_look_as_the_slab_does(void **state)
{
	(void)state;
	static const struct {
		double thickness_m, mu_v, azimuth;
		bool above;
	} views[] = {{60, 0.9, 1.6, false}, {60, 0.6, 2.4, true}, {200, 0.6, 1.2, false}, {200, 0.8, 2.2, true}, {500, 1, 0, false}};
	for (size_t i = 0; i < sizeof views / sizeof *views; i++) {
		const struct layer_case is = {.tables = tables, .thickness_m = views[i].thickness_m, .sun_zenith_deg = 50, .sun = true};
		struct uniform_layer layer;
		layer_init(&layer, &is);
		const struct layer_seen seen = layer_see(&layer, views[i].above, views[i].mu_v, views[i].azimuth, 60000, THREADS);
		for (int band = 0; band < 3; band++) {
			const double expected = slab_at(&is, band, views[i].above, views[i].mu_v, views[i].azimuth);
			print_message("%g m, mu %g, band %d: %.4f +- %.4f, slab %.4f\n", is.thickness_m, views[i].mu_v, band,
				      seen.mean[band], seen.error[band], expected);
			assert_true(seen.error[band] < 0.025 * expected);
			assert_true(fabs(seen.mean[band] - expected) < 3 * seen.error[band] + 0.01 * expected);
		}
		layer_finish(&layer);
	}
}

/* Ways to a low sun bend by more than a little of its height, and leave the layer elsewhere than the straight one: seen in the mean over
 * directions, by how far each is known. */
static void low_suns_lose_nothing(void **state)
{
	(void)state;
	static const double mu_v[] = {0.65, 0.7, 0.55, 0.85, 0.4, 0.3, 0.9, 0.8}, azimuth[] = {1.3, 1.9, 0.6, 0.1, 2.4, 0.9, 2.8, 3.1};
	const struct layer_case is = {.tables = tables, .thickness_m = 80, .sun_zenith_deg = 80, .sun = true};
	struct uniform_layer layer;
	layer_init(&layer, &is);
	double deviation = 0, weights = 0;
	for (int i = 0; i < 8; i++) {
		const bool above = i % 2;
		const struct layer_seen seen = layer_see(&layer, above, mu_v[i], azimuth[i], 100000, THREADS);
		const double expected = slab_at(&is, 1, above, mu_v[i], azimuth[i]), weight = pow(expected / seen.error[1], 2);
		deviation += weight * (seen.mean[1] / expected - 1);
		weights += weight;
	}
	layer_finish(&layer);
	print_message("sun at 10 degrees: %.2f +- %.2f %% off\n", 100 * deviation / weights, 100 / sqrt(weights));
	assert_true(1 / sqrt(weights) < 0.006);
	assert_true(fabs(deviation / weights) < 3 / sqrt(weights));
}

/* Beside the sun all light has been scattered forward alone; no sample of it outshines the others. */
static void aureoles_are_even(void **state)
{
	(void)state;
	const struct layer_case is = {.tables = tables, .thickness_m = 60, .sun_zenith_deg = 55, .sun = true};
	struct uniform_layer layer;
	layer_init(&layer, &is);
	for (int i = 0; i < 2; i++) {
		const double mu_v = cos((i == 0 ? 52 : 59) * DEGREE);
		const struct layer_seen seen = layer_see(&layer, false, mu_v, 0, 60000, THREADS);
		const double expected = slab_at(&is, 1, false, mu_v, 0);
		print_message("%d degrees from the sun: %.4f +- %.4f, slab %.4f\n", i == 0 ? 3 : 4, seen.mean[1], seen.error[1], expected);
		assert_true(seen.error[1] < 0.012 * expected);
		assert_true(fabs(seen.mean[1] - expected) < 3 * seen.error[1] + 0.01 * expected);
	}
	layer_finish(&layer);
}

/* F0 P/(4 pi) mu_l/(mu_l +- mu_v) (...), of so thin a layer tau P/(4 pi mu_v); what is scattered twice is a share of tau. */
static void thin_layers_scatter_once(void **state)
{
	(void)state;
	const double mu_l = cos(50 * DEGREE), mu_v = 0.7, azimuth = 2;
	const struct layer_case is = {.tables = tables, .thickness_m = 0.05, .sun_zenith_deg = 50, .sun = true};
	for (int above = 0; above < 2; above++) {
		struct uniform_layer layer;
		layer_init(&layer, &is);
		const struct layer_seen seen = layer_see(&layer, above, mu_v, azimuth, 8000000, THREADS);
		for (int band = 0; band < 3; band++) {
			const double tau = is.thickness_m * tables->optics->extinction_per_m[band];
			const double angle = acos(slab_scattering_cosine(above ? SLAB_REFLECTED : SLAB_TRANSMITTED, mu_l, mu_v, azimuth));
			const double expected = optics_phase(tables->optics, band, angle) / (4 * M_PI) * tau / mu_v;
			print_message("band %d: %.4e +- %.1e, once scattered %.4e\n", band, seen.mean[band], seen.error[band], expected);
			assert_true(seen.error[band] < 0.02 * expected);
			assert_true(fabs(seen.mean[band] - expected) < 3 * seen.error[band] + 0.005 * expected);
		}
		layer_finish(&layer);
	}
}

/* Droplets and a white ground lose nothing. */
static void furnace_is_white(void **state)
{
	(void)state;
	static const double thickness_m[] = {5, 100, 400};
	for (int i = 0; i < 3; i++) {
		const struct layer_case is = {.tables = tables, .thickness_m = thickness_m[i], .sky = 1, .ground_albedo = 1};
		struct uniform_layer layer;
		layer_init(&layer, &is);
		for (int above = 0; above < 2; above++) {
			const struct layer_seen seen = layer_see(&layer, above, 0.6, 1, 60000, THREADS);
			for (int band = 0; band < 3; band++) {
				print_message("%g m, band %d: %.4f +- %.4f\n", is.thickness_m, band, seen.mean[band], seen.error[band]);
				assert_true(seen.error[band] < 0.005);
				assert_true(fabs(seen.mean[band] - 1) < 0.01);
			}
		}
		layer_finish(&layer);
	}
}

/* The same numbers, whatever the threads; others for another seed. */
static void samples_depend_on_the_seed_alone(void **state)
{
	(void)state;
	const struct layer_case is = {.tables = tables, .thickness_m = 100, .sun_zenith_deg = 40, .sun = true};
	struct layer_seen seen[3];
	for (int i = 0; i < 3; i++) {
		struct uniform_layer layer;
		layer_init(&layer, &is);
		layer.twin.seed = i == 2 ? 77 : 5;
		seen[i] = layer_see(&layer, false, 0.8, 1, 2000, i + 1);
		layer_finish(&layer);
	}
	assert_true(seen[0].mean[1] == seen[1].mean[1] && seen[0].error[0] == seen[1].error[0]);
	assert_true(seen[0].mean[1] != seen[2].mean[1]);
}

int main(void)
{
	const char *path = getenv("STRATUS_KERNEL");
	struct kernel *kernel = kernel_load(path ? path : "build/mie.kernel");
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(layers_look_as_the_slab_does),
		cmocka_unit_test(low_suns_lose_nothing),
		cmocka_unit_test(aureoles_are_even),
		cmocka_unit_test(thin_layers_scatter_once),
		cmocka_unit_test(furnace_is_white),
		cmocka_unit_test(samples_depend_on_the_seed_alone),
	};
	tables = kernel ? droplet_tables_create(kernel, &dsd, OPTICS_MIE, THREADS) : NULL;
	const int failed = tables ? cmocka_run_group_tests(tests, NULL, NULL) : 1;
	droplet_tables_destroy(tables);
	kernel_destroy(kernel);
	return failed;
}
