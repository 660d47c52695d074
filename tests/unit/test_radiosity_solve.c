/* Light between ground and cloud base: against the plain series of its bounces, closed forms, and its own balance. */
#include "renderer/stages/radiosity_solve.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { SIDE = 32, COUNT = SIDE * SIDE, VALUES = EXCHANGE_BANDS * COUNT };

static const double tile = 9000, base = 900, drift[] = {0.2371, 0.8117};

struct setup {
	float source[VALUES], cloud_albedo[VALUES], ground_albedo[VALUES], direct[VALUES];
	float ground_received[VALUES], cloud_received[VALUES];
	struct radiosity_solution solution;
};

static float *kernel;

static void solve(struct setup *setup, double tolerance, int max_passes)
{
	struct exchange exchange;
	const struct radiosity_planes planes = {setup->source, setup->cloud_albedo, setup->ground_albedo, setup->direct};
	setup->solution = (struct radiosity_solution){.ground_received = setup->ground_received, .cloud_received = setup->cloud_received};
	assert_true(exchange_init(&exchange, SIDE, kernel, drift));
	assert_true(radiosity_solve(&exchange, &planes, tolerance, max_passes, &setup->solution));
	exchange_finish(&exchange);
}

static void fill_uniform(struct setup *setup, const double source[3], double direct, const double ground[3], const double cloud[3])
{
	for (int i = 0; i < VALUES; i++) {
		setup->source[i] = (float)source[i / COUNT];
		setup->direct[i] = (float)direct;
		setup->ground_albedo[i] = (float)ground[i / COUNT];
		setup->cloud_albedo[i] = (float)cloud[i / COUNT];
	}
}

/* Floes in water under a deck with holes: what is bright lies in patches on both planes. */
static void fill_patches(struct setup *setup, double ice, double deck)
{
	for (int i = 0; i < VALUES; i++) {
		const int x = i % SIDE, y = i % COUNT / SIDE, band = i / COUNT;
		const bool hole = (x + 5) % 16 < 5 && y % 16 < 6, water = x % 19 < 7 || y % 13 < 3;
		setup->cloud_albedo[i] = hole ? 0 : (float)deck;
		setup->source[i] = hole ? 0.1f : (float)(1 - deck) * (float)(1 + band);
		setup->direct[i] = hole ? 0.9f : 0;
		setup->ground_albedo[i] = water ? 0.06f : (float)ice;
	}
}

/* --- the series ------------------------------------------------------------------------------------------------------------------ */

static void solution_is_the_sum_of_all_bounces(void **state)
{
	(void)state;
	static struct setup setup;
	static float sends[VALUES], received[VALUES], total[VALUES];
	struct exchange exchange;
	assert_true(exchange_init(&exchange, SIDE, kernel, drift));
	fill_patches(&setup, 0.85, 0.8);
	solve(&setup, 1e-6, 200);
	memcpy(sends, setup.source, sizeof sends);
	memset(total, 0, sizeof total);
	for (int bounce = 0; bounce < 200; bounce++) {
		exchange_receive(&exchange, EXCHANGE_DOWN, sends, received);
		for (int i = 0; i < VALUES; i++) {
			total[i] += received[i];
			sends[i] = setup.ground_albedo[i] * (received[i] + (bounce == 0 ? setup.direct[i] : 0));
		}
		exchange_receive(&exchange, EXCHANGE_UP, sends, received);
		for (int i = 0; i < VALUES; i++)
			sends[i] = setup.cloud_albedo[i] * received[i];
	}
	for (int i = 0; i < VALUES; i++)
		assert_float_equal(setup.ground_received[i] / total[i], 1, 2e-5);
	for (int i = 0; i < VALUES; i++)
		sends[i] = setup.ground_albedo[i] * (total[i] + setup.direct[i]);
	exchange_receive(&exchange, EXCHANGE_LEVEL, sends, received);
	for (int i = 0; i < VALUES; i++)
		assert_float_equal(setup.cloud_received[i] / received[i], 1, 2e-5);
	exchange_finish(&exchange);
}

/* Uniform planes: G = (source + a_C a_G direct) / (1 - a_G a_C), at once. */
static void uniform_planes_close_the_series(void **state)
{
	(void)state;
	static struct setup setup;
	const double source[] = {0.7, 0.2, 1.3}, direct = 0.4;
	static const double ground[][3] = {{0, 0, 0}, {0.06, 0.5, 0.9}, {0.33, 1, 0.85}}, cloud[][3] = {{0, 0, 0}, {0.3, 0.9, 0.99}};
	for (int i = 0; i < 3; i++)
		for (int k = 0; k < 2; k++) {
			fill_uniform(&setup, source, direct, ground[i], cloud[k]);
			solve(&setup, 1e-5, 64);
			assert_in_range(setup.solution.passes, 1, 2);
			for (int band = 0; band < 3; band++) {
				const double g = ground[i][band], c = cloud[k][band], series = 1 / (1 - g * c);
				const double wanted = (source[band] + g * c * direct) * series, up = g * (source[band] + direct) * series;
				assert_float_equal(setup.solution.ground_diffuse[band], wanted, 1e-4 * wanted);
				assert_float_equal(setup.solution.ground_direct[band], direct, 1e-6);
				assert_float_equal(setup.cloud_received[band * COUNT + 77], up, 1e-4 * up + 1e-6);
			}
		}
}

/* White ground under a deck through which next to nothing comes: what comes in is large, and finite. */
static void white_ground_does_not_diverge(void **state)
{
	(void)state;
	static struct setup setup;
	const double ground[] = {1, 1, 1};
	for (double through = 0.1; through > 2e-4; through /= 10) {
		const double source[] = {through, through, through}, cloud[] = {1 - through, 1 - through, 1 - through};
		fill_uniform(&setup, source, 0, ground, cloud);
		solve(&setup, 1e-4, 64);
		assert_float_equal(setup.solution.ground_diffuse[1], 1, 2e-3);
		for (int i = 0; i < COUNT; i++) /* and with something to iterate over */
			setup.cloud_albedo[i] -= (float)(through * (i % 7) / 14);
		solve(&setup, 1e-6, 64);
		assert_true(setup.solution.last_residual <= 1e-6);
		assert_true(setup.solution.ground_diffuse[0] > 0.5 && setup.solution.ground_diffuse[0] < 1);
	}
}

/* --- the balance ----------------------------------------------------------------------------------------------------------------- */

static double mean_of(const float *values)
{
	double sum = 0;
	for (int i = 0; i < VALUES; i++)
		sum += (double)values[i] / VALUES;
	return sum;
}

/* What comes in below the deck, by the base's own light and the beam, the ground takes, or it goes out through the deck again. */
static double imbalance(const struct setup *setup)
{
	static float sends[VALUES], up[VALUES];
	struct exchange exchange;
	assert_true(exchange_init(&exchange, SIDE, kernel, drift));
	double taken = 0, out = 0;
	for (int i = 0; i < VALUES; i++) {
		const double light = (double)(setup->ground_received[i] + setup->direct[i]);
		sends[i] = (float)((double)setup->ground_albedo[i] * light);
		taken += (1 - (double)setup->ground_albedo[i]) * light / VALUES;
	}
	exchange_receive(&exchange, EXCHANGE_UP, sends, up);
	for (int i = 0; i < VALUES; i++)
		out += (1 - (double)setup->cloud_albedo[i]) * (double)up[i] / VALUES;
	exchange_finish(&exchange);
	const double in = mean_of(setup->source) + mean_of(setup->direct);
	return (taken + out) / in - 1;
}

static void what_comes_in_stays_or_leaves(void **state)
{
	(void)state;
	static struct setup setup;
	static const double ices[] = {0.1, 0.5, 0.85, 1}, decks[] = {0.2, 0.6, 0.9};
	for (int i = 0; i < 4; i++)
		for (int k = 0; k < 3; k++) {
			fill_patches(&setup, ices[i], decks[k]);
			solve(&setup, 1e-3, 64);
			print_message("ice %.2f, deck %.1f: %d passes to %.1e, balance off by %.1e\n", ices[i], decks[k],
				      setup.solution.passes, setup.solution.last_residual, imbalance(&setup));
			assert_float_equal(imbalance(&setup), 0, 0.002);
			solve(&setup, 1e-6, 64);
			assert_float_equal(imbalance(&setup), 0, 1e-5);
		}
}

/* --- its settings ---------------------------------------------------------------------------------------------------------------- */

static void tolerance_and_passes_mean_what_they_say(void **state)
{
	(void)state;
	static struct setup setup;
	fill_patches(&setup, 0.9, 0.9);
	solve(&setup, 1e-6, 1024);
	const int all = setup.solution.passes;
	double residual[RADIOSITY_PASSES_LISTED];
	memcpy(residual, setup.solution.residual, sizeof residual);
	assert_in_range(all, 4, 24);
	for (int i = 1; i < all; i++)
		assert_true(residual[i] < residual[i - 1]);
	assert_true(residual[all - 1] <= 1e-6 && residual[all - 2] > 1e-6);
	for (int passes = 1; passes <= all; passes++) {
		solve(&setup, 1e-6, passes);
		assert_int_equal(setup.solution.passes, passes);
		assert_float_equal(setup.solution.last_residual, residual[passes - 1], 1e-9);
		solve(&setup, residual[passes - 1], 1024);
		assert_int_equal(setup.solution.passes, passes);
	}
}

/* The residual says how far off the light is: the remaining series is at most 1/(1 - a_G a_C) times as much. */
static void residual_bounds_the_error(void **state)
{
	(void)state;
	static struct setup exact, setup;
	fill_patches(&exact, 0.85, 0.8);
	fill_patches(&setup, 0.85, 0.8);
	solve(&exact, 1e-6, 1024);
	for (int passes = 1; passes < 6; passes++) {
		solve(&setup, 1e-6, passes);
		double squares = 0;
		for (int i = 0; i < COUNT; i++)
			squares += pow((double)(setup.ground_received[i] - exact.ground_received[i]), 2) / COUNT;
		const double error = sqrt(squares) / (exact.solution.ground_diffuse[0] + exact.solution.ground_direct[0]);
		assert_true(error < setup.solution.last_residual / (1 - 0.85 * 0.8) + 1e-5);
	}
}

/* Without passes the ground has what the base sends by itself, and the base nothing of the ground's. */
static void no_passes_leave_the_first_light(void **state)
{
	(void)state;
	static struct setup setup;
	static float received[VALUES];
	struct exchange exchange;
	fill_patches(&setup, 0.8, 0.7);
	solve(&setup, 1e-3, 0);
	assert_true(exchange_init(&exchange, SIDE, kernel, drift));
	exchange_receive(&exchange, EXCHANGE_DOWN, setup.source, received);
	exchange_finish(&exchange);
	assert_memory_equal(received, setup.ground_received, sizeof received);
	for (int i = 0; i < VALUES; i++)
		assert_true(setup.cloud_received[i] == 0);
	assert_int_equal(setup.solution.passes, 0);
	assert_true(setup.solution.last_residual == 0);
}

static void darkness_stays_dark(void **state)
{
	(void)state;
	static struct setup setup;
	fill_patches(&setup, 0.8, 0.7);
	memset(setup.source, 0, sizeof setup.source);
	memset(setup.direct, 0, sizeof setup.direct);
	solve(&setup, 1e-3, 64);
	for (int i = 0; i < VALUES; i++)
		assert_true(setup.ground_received[i] == 0 && setup.cloud_received[i] == 0);
	assert_int_equal(setup.solution.passes, 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(solution_is_the_sum_of_all_bounces),      cmocka_unit_test(uniform_planes_close_the_series),
		cmocka_unit_test(white_ground_does_not_diverge),           cmocka_unit_test(what_comes_in_stays_or_leaves),
		cmocka_unit_test(tolerance_and_passes_mean_what_they_say), cmocka_unit_test(residual_bounds_the_error),
		cmocka_unit_test(no_passes_leave_the_first_light),         cmocka_unit_test(darkness_stays_dark),
	};
	kernel = exchange_kernel_create(SIDE, tile, base);
	if (!kernel)
		return 1;
	const int failed = cmocka_run_group_tests(tests, NULL, NULL);
	free(kernel);
	return failed;
}
