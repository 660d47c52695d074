/* Radiances of the paper's slab: their fluxes are the orders they were made from. Wants build/mie.kernel, or the file that STRATUS_KERNEL
 * names. */
#include "renderer/optics/kernel.h"
#include "renderer/optics/paper_radiance.h"
#include "renderer/optics/quadrature.h"
#include "tests/unit/numbers.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#define DEGREE (M_PI / 180)

struct fixture {
	struct kernel *kernel;
	struct optics *optics;
	struct forward_tables *forward;
	struct slab_solution *solution;
	struct paper_fit_table table;
};

static bool fixture_make(struct fixture *fixture, double gamma, double radius_um)
{
	fixture->optics = optics_create(fixture->kernel, &(struct scene_dsd){10, gamma, radius_um}, OPTICS_MIE);
	fixture->forward = malloc(sizeof *fixture->forward);
	fixture->solution = fixture->optics ? slab_solve(fixture->optics, 2) : NULL;
	if (!fixture->solution || !fixture->forward)
		return false;
	forward_tables_compute(fixture->optics, fixture->forward);
	return paper_fit_table_compute(fixture->optics, fixture->solution, 2, &fixture->table);
}

static void fixture_clear(struct fixture *fixture)
{
	slab_destroy(fixture->solution);
	free(fixture->forward);
	optics_destroy(fixture->optics);
}

static struct paper_layer layer_of(const struct fixture *fixture, int band, double tau, double mu_l)
{
	struct paper_layer layer;
	paper_layer_init(&layer, &fixture->table, fixture->optics, fixture->forward, band, tau, mu_l);
	return layer;
}

/* Fluxes through one side by order, fractions of the incident flux: midpoint rule in azimuth, Gauss in the cosine on both sides of the
 * sun's, where the aureole stands, crowded there by a cube. */
static void fluxes(const struct paper_layer *layer, enum slab_side side, double flux[4])
{
	enum { NODES = 48, AZIMUTHS = 720 };
	double node[NODES], weight[NODES];
	quadrature_gauss(NODES, node, weight);
	for (int order = 0; order < 4; order++)
		flux[order] = 0;
	for (int half = 0; half < 2; half++)
		for (int i = 0; i < NODES; i++) {
			double to = half ? 1 : 0, x = node[i];
			double mu = layer->mu_l + (to - layer->mu_l) * x * x * x, dmu = fabs(to - layer->mu_l) * 3 * x * x * weight[i];
			for (int j = 0; j < AZIMUTHS; j++) {
				/* Crowded towards the sun's azimuth likewise; the other half is the mirror image. */
				double y = (j + 0.5) / AZIMUTHS, step = M_PI * 3 * y * y / AZIMUTHS;
				struct paper_radiance radiance = paper_radiance_at(layer, side, mu, M_PI * y * y * y);
				for (int order = 0; order < 4; order++)
					flux[order] += 2 * radiance.order[order] * mu * dmu * step / layer->mu_l;
			}
		}
}

static void orders_two_and_more(void **state)
{
	const struct fixture *fixture = *state;
	for (double tau = 0.3; tau < 100; tau *= 4)
		for (double zenith = 0; zenith < 80; zenith += 25) {
			struct paper_layer layer = layer_of(fixture, 1, tau, cos(zenith * DEGREE));
			double reflected[4], transmitted[4];
			fluxes(&layer, SLAB_REFLECTED, reflected);
			fluxes(&layer, SLAB_TRANSMITTED, transmitted);
			assert_near(reflected[3], layer.orders.r[3], 1e-4, "R3+");
			assert_near(transmitted[3], layer.orders.t[3], 1e-4, "T3+");
			if (layer.double_scale[SLAB_REFLECTED] < PAPER_SCALE_MAX)
				assert_near(reflected[2] / layer.orders.r[2], 1, 0.01, "R2");
			if (layer.double_scale[SLAB_TRANSMITTED] < PAPER_SCALE_MAX && layer.orders.t[2] > 1e-9)
				assert_near(transmitted[2] / layer.orders.t[2], 1, 0.01, "T2");
		}
}

/* Single scattering is analytic, so its flux is the first order of an exact solution; order 0 and the unscattered light are the exact T0.
 */
static void orders_none_and_one(void **state)
{
	const struct fixture *fixture = *state;
	for (double tau = 0.05; tau < 10; tau *= 3)
		for (double zenith = 0; zenith < 65; zenith += 30) {
			double mu_l = cos(zenith * DEGREE);
			struct paper_layer layer = layer_of(fixture, 1, tau, mu_l);
			struct slab_orders exact = slab_orders_at(fixture->optics, 1, SLAB_PHASE_MODIFIED, tau, mu_l);
			double reflected[4], transmitted[4];
			fluxes(&layer, SLAB_REFLECTED, reflected);
			fluxes(&layer, SLAB_TRANSMITTED, transmitted);
			assert_near(reflected[0], 0, 0, "R0");
			assert_near(reflected[1], exact.r[1], 1e-4, "R1");
			assert_near(transmitted[0] + exp(-tau / mu_l), exact.t[0], 0.003, "T0");
			assert_near(transmitted[1], exact.t[1], 0.003, "T1");
		}
}

/* The one-dimensional model of each band is near the solver's orders: its similarity is used the right way round. */
static void orders_of_all_bands(void **state)
{
	const struct fixture *fixture = *state;
	for (int band = 0; band < BAND_COUNT; band++)
		for (double tau = 0.25; tau < 200; tau *= 2)
			for (double zenith = 0; zenith < 80; zenith += 20) {
				double mu_l = cos(zenith * DEGREE);
				struct paper_orders model = paper_layer_orders(&fixture->table, fixture->optics, band, tau, mu_l);
				struct slab_orders exact = slab_orders_at(fixture->optics, band, SLAB_PHASE_MODIFIED, tau, mu_l);
				assert_near(model.t[0], exact.t[0], 2e-3, "T0");
				for (int order = 1; order < 4; order++) {
					assert_near(model.r[order], exact.r[order], 0.05, "R of the model");
					assert_near(model.t[order], exact.t[order], 0.05, "T of the model");
				}
			}
}

/* Almost all light of a very thin layer was scattered once, by the full phase function. */
static void thin_layers(void **state)
{
	const struct fixture *fixture = *state;
	for (double tau = 1e-6; tau < 2e-3; tau *= 10)
		for (int side = 0; side < SLAB_SIDE_COUNT; side++)
			for (double degrees = 0; degrees <= 180; degrees += 7.5) {
				double mu_l = 0.7, mu_v = 0.6;
				struct paper_layer layer = layer_of(fixture, 2, tau, mu_l);
				struct paper_radiance radiance = paper_radiance_at(&layer, (enum slab_side)side, mu_v, degrees * DEGREE);
				double angle = acos(slab_scattering_cosine((enum slab_side)side, mu_l, mu_v, degrees * DEGREE));
				double once = tau / mu_v * optics_phase(fixture->optics, 2, angle) / (4 * M_PI);
				assert_near((radiance.order[0] + radiance.order[1]) / once, 1, 0.01 + 10 * tau, "single scattering");
			}
}

/* No step where the peak ends, in the sum of orders. */
static void edge_of_the_peak(void **state)
{
	const struct fixture *fixture = *state;
	for (double tau = 0.1; tau < 30; tau *= 3) {
		struct paper_layer layer = layer_of(fixture, 1, tau, 1);
		struct paper_radiance in = paper_radiance_at(&layer, SLAB_TRANSMITTED, cos(FORWARD_PEAK_ANGLE * 0.9999), 0);
		struct paper_radiance out = paper_radiance_at(&layer, SLAB_TRANSMITTED, cos(FORWARD_PEAK_ANGLE * 1.0001), 0);
		assert_near((in.order[0] + in.order[1]) / (out.order[0] + out.order[1]), 1, 0.002, "across the edge");
		assert_true(in.order[0] > out.order[0] && in.order[1] < out.order[1]);
	}
}

static void check_sound(const struct fixture *fixture)
{
	static const double depths[] = {0, 1e-300, 1e-6, 0.05, 1, 30, 1000, 1e6, 1e300, INFINITY};
	static const double cosines[] = {0, 1e-300, 1e-4, 0.1, 0.5, 1};
	static const double azimuths[] = {0, 1e-9, 1.5, M_PI, -4, 100, NAN};
	for (int i = 0; i < 10 * 6 * 6 * 7 * SLAB_SIDE_COUNT * BAND_COUNT; i++) {
		int k = i, band = k % BAND_COUNT, side = (k /= BAND_COUNT) % SLAB_SIDE_COUNT;
		k /= SLAB_SIDE_COUNT;
		struct paper_layer layer = layer_of(fixture, band, depths[k % 10], cosines[k / 10 % 6]);
		struct paper_radiance radiance = paper_radiance_at(&layer, (enum slab_side)side, cosines[k / 60 % 6], azimuths[k / 360]);
		for (int order = 0; order < 4; order++)
			assert_true(isfinite(radiance.order[order]) && radiance.order[order] >= 0);
	}
}

static void sound_everywhere(void **state)
{
	static const double dsd[][2] = {{1, 1}, {20, 1}, {1, 30}, {20, 30}, {7, 4}};
	const struct fixture *given = *state;
	check_sound(given);
	for (int i = 0; i < 5; i++) {
		struct fixture fixture = {.kernel = given->kernel};
		assert_true(fixture_make(&fixture, dsd[i][0], dsd[i][1]));
		check_sound(&fixture);
		fixture_clear(&fixture);
	}
}

static int set_up(void **state)
{
	static struct fixture fixture;
	const char *path = getenv("STRATUS_KERNEL");
	fixture.kernel = kernel_load(path ? path : "build/mie.kernel");
	*state = &fixture;
	return fixture.kernel && fixture_make(&fixture, 2, 7) ? 0 : -1;
}

static int tear_down(void **state)
{
	struct fixture *fixture = *state;
	fixture_clear(fixture);
	kernel_destroy(fixture->kernel);
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(orders_two_and_more), cmocka_unit_test(orders_none_and_one), cmocka_unit_test(orders_of_all_bands),
		cmocka_unit_test(thin_layers),         cmocka_unit_test(edge_of_the_peak),    cmocka_unit_test(sound_everywhere),
	};
	return cmocka_run_group_tests(tests, set_up, tear_down);
}
