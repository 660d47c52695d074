/* The paper's slab with its printed parameters against its own integrals and solvers of radiative transfer. */
#include "renderer/optics/paper_fit.h"

#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#define DEGREE (M_PI / 180)

static struct paper_fit published_at(double zenith_rad)
{
	const struct paper_fit_table table = paper_fit_table_published();
	return paper_fit_table_at(&table, zenith_rad);
}

/* beta is T_ms of a metre when nothing corrects it, and two layers join as the paper derives. */
static void transmittance_composes(void **state)
{
	(void)state;
	struct paper_fit plain = {.beta = 0.9961, .b = 1, .c = 0};
	assert_float_equal(paper_transmittance(&plain, 1), 0.9961, 1e-12);
	for (double h = 0.1; h < 1e4; h *= 3) {
		double once = paper_transmittance(&plain, h);
		assert_float_equal(paper_transmittance(&plain, 2 * h), once / (2 - once), 1e-12);
	}
}

static void transmittance_limits(void **state)
{
	(void)state;
	for (int degrees = 0; degrees <= 90; degrees++) {
		struct paper_fit fit = published_at(degrees * DEGREE);
		assert_float_equal(paper_transmittance(&fit, 0), 1, 1e-12);
		assert_float_equal(paper_transmittance(&fit, -5), 1, 1e-12);
		assert_true(paper_transmittance(&fit, 1e30) < 1e-5);
		double before = 1;
		for (double h = 0.01; h < 1e5; h *= 1.2) {
			double now = paper_transmittance(&fit, h);
			assert_true(now <= before && now >= 0);
			before = now;
		}
	}
}

/* T_ms was fitted to photon tracing: within 0.01 of discrete ordinates. */
static void transmittance_against_solver(void **state)
{
	(void)state;
	json_t *root = json_load_file("tests/data/slab.json", 0, NULL), *row;
	assert_non_null(root);
	size_t i;
	json_array_foreach(json_object_get(json_object_get(root, "fluxes"), "rows"), i, row)
	{
		double tau = json_number_value(json_array_get(row, 0)), zenith = json_number_value(json_array_get(row, 1)) * DEGREE;
		struct paper_fit fit = published_at(zenith);
		double transmittance = paper_transmittance(&fit, tau / paper_fit_table_published().extinction_per_m);
		assert_float_equal(transmittance, json_number_value(json_array_get(row, 5)), 0.01);
	}
	assert_int_equal(i, 8);
	json_decref(root);
}

/* The 1D integrals of appendix A by the midpoint rule, without their closed forms. */
static void orders_are_their_integrals(void **state)
{
	(void)state;
	static const double degrees[] = {0, 25, 55}, thickness[] = {2, 4, 20, 90};
	for (int k = 0; k < 12; k++) {
		struct paper_fit fit = published_at(degrees[k % 3] * DEGREE);
		double h = thickness[k / 3], kappa = fit.kappa_c, t1 = 0, r1 = 0, t2 = 0, r2 = 0;
		enum { STEPS = 800 };
		double step = h / STEPS;
		for (int i = 0; i < STEPS; i++) {
			double first = (i + 0.5) * step, s = kappa * exp(-kappa * first) * step; /* depth of the first event */
			t1 += s * fit.t * exp(-kappa * (h - first));
			r1 += s * fit.r * exp(-kappa * first);
			for (int j = 0; j < STEPS; j++) { /* depth of the second */
				double second = (j + 0.5) * step;
				double event = (i == j ? 0.5 : 1) * s * kappa * exp(-kappa * fabs(second - first)) * step;
				/* The diagonal cell is half above, half below; its two halves are one triangle each. */
				if (j >= i) {
					t2 += event * fit.t * fit.t * exp(-kappa * (h - second));
					r2 += event * fit.t * fit.r * exp(-kappa * second);
				}
				if (j <= i) {
					t2 += event * fit.r * fit.r * exp(-kappa * (h - second));
					r2 += event * fit.r * fit.t * exp(-kappa * second);
				}
			}
		}
		struct paper_orders orders = paper_orders_at(&fit, h, INFINITY);
		/* In thin layers the first two orders are scaled by a common factor; the integrals need not know it. */
		double claim = (r1 + r2) / orders.r_total, scale = claim > 1 ? 1 / claim : 1;
		assert_float_equal(orders.t[1] / t1, 1, 1e-4);
		assert_float_equal(orders.t[2] / t2, 1, 2e-4);
		assert_float_equal(orders.r[1] / (scale * r1), 1, 1e-4);
		assert_float_equal(orders.r[2] / (scale * r2), 1, 2e-4);
	}
}

/* T_2's closed form loses its digits in thin layers; both sides of the switch to the series agree with more of them. */
static void thin_layers(void **state)
{
	(void)state;
	struct paper_fit fit = published_at(10 * DEGREE);
	fit.t = 0.01; /* leaves the part that is scattered back twice */
	for (double depth = 1e-4; depth < 1; depth *= 1.07) {
		long double k = depth, rest = 2 * k - 1 + expl(-2 * k), more = 1 - (2 * k + 1) * expl(-2 * k);
		struct paper_orders orders = paper_orders_at(&fit, depth / fit.kappa_c, INFINITY);
		double t2 = (double)(fit.t * fit.t * k * k / 2 * expl(-k) + fit.r * fit.r / 4 * expl(-k) * rest);
		double r2 = (double)(fit.r * fit.t / 2 * more);
		assert_float_equal(orders.t[2] / t2, 1, 1e-8);
		assert_float_equal(orders.r[2] / r2, 1, 1e-8);
	}
}

static void assert_sound(const struct paper_orders *orders)
{
	double t = 0, r = 0;
	for (int i = 0; i < 4; i++) {
		assert_true(isfinite(orders->t[i]) && orders->t[i] >= 0);
		assert_true(isfinite(orders->r[i]) && orders->r[i] >= 0);
		t += orders->t[i];
		r += orders->r[i];
	}
	assert_true(orders->r[0] == 0);
	assert_float_equal(t, orders->t_total, 1e-12);
	assert_float_equal(r, orders->r_total, 1e-12);
	assert_float_equal(t + r, 1, 1e-12);
}

static void orders_add_up(void **state)
{
	(void)state;
	static const double thickness[] = {0, 1e-300, 1e-9, 0.01, 1, 30, 300, 3000, 1e8, 1e300, INFINITY};
	static const double slant[] = {0, 1e-12, 0.1, 5, 1e4, INFINITY};
	for (int degrees = 0; degrees <= 90; degrees++)
		for (int k = 0; k < 66; k++) {
			struct paper_fit fit = published_at(degrees * DEGREE);
			struct paper_orders orders = paper_orders_at(&fit, thickness[k % 11], slant[k / 11]);
			assert_sound(&orders);
			assert_float_equal(orders.t[0], exp(-slant[k / 11]), 1e-12);
		}
	struct paper_fit fit = published_at(0.5);
	struct paper_orders none = paper_orders_at(&fit, 0, 0), thick = paper_orders_at(&fit, 1e7, 2e5);
	assert_float_equal(none.t[0], 1, 1e-12);
	assert_float_equal(thick.r_total, 1, 1e-3);
	assert_float_equal(thick.r[1], fit.r / 2, 1e-9);
	assert_float_equal(thick.r[2], fit.r * fit.t / 2, 1e-9);
}

/* The paper calls its fit of the orders almost perfect; at 30 degrees, with its own extinction N0 pi re^2 and its own thickness, it is
 * within 0.02 of photon tracing of the modified phase function. */
static void orders_against_photons(void **state)
{
	(void)state;
	json_t *root = json_load_file("tests/data/slab.json", 0, NULL), *row;
	assert_non_null(root);
	size_t i;
	int tested = 0;
	json_array_foreach(json_object_get(json_object_get(root, "orders_of_scattering"), "rows"), i, row)
	{
		if (strncmp(json_string_value(json_object_get(row, "phase")), "modified", 8) != 0)
			continue;
		double tau = json_number_value(json_object_get(row, "tau_vertical"));
		struct paper_fit fit = published_at(30 * DEGREE);
		struct paper_orders orders = paper_orders_at(&fit, json_number_value(json_object_get(row, "H_m")), tau / cos(30 * DEGREE));
		assert_float_equal(orders.t[0], json_number_value(json_object_get(row, "T0")), 0.001);
		assert_float_equal(orders.t[1], json_number_value(json_object_get(row, "T1")), 0.01);
		assert_float_equal(orders.t[2], json_number_value(json_object_get(row, "T2")), 0.02);
		assert_float_equal(orders.r[1], json_number_value(json_object_get(row, "R1")), 0.005);
		assert_float_equal(orders.r[2], json_number_value(json_object_get(row, "R2")), 0.008);
		tested++;
	}
	assert_int_equal(tested, 3);
	json_decref(root);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(transmittance_composes),
		cmocka_unit_test(transmittance_limits),
		cmocka_unit_test(transmittance_against_solver),
		cmocka_unit_test(orders_are_their_integrals),
		cmocka_unit_test(thin_layers),
		cmocka_unit_test(orders_add_up),
		cmocka_unit_test(orders_against_photons),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
