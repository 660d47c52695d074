/* The tables of forward scattering. Wants build/mie.kernel, or the file that STRATUS_KERNEL names. */
#include "renderer/optics/forward.h"
#include "renderer/optics/kernel.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

static struct forward_tables tables; /* 0.5 MB */

static double depth_at(int i)
{
	return forward_depth_at((i + 0.5) / FORWARD_DEPTH_COUNT);
}

static double peak_angle(int i)
{
	double t = i / (FORWARD_ANGLE_COUNT - 1.0);
	return t * t * FORWARD_ANGLE_MAX;
}

static double blur_angle(int i)
{
	return i * M_PI / (BLUR_ANGLE_COUNT - 1);
}

static void assert_relative(double value, double expected, double tolerance)
{
	if (!(fabs(value - expected) <= tolerance * fabs(expected)))
		fail_msg("%.9g instead of %.9g", value, expected);
}

static struct optics *make(void **state, double gamma, double re)
{
	struct optics *optics = optics_create(*state, &(struct scene_dsd){300, gamma, re}, OPTICS_MIE);
	assert_non_null(optics);
	forward_tables_compute(optics, &tables);
	return optics;
}

static void depth_coordinate(void **state)
{
	(void)state;
	assert_true(forward_depth_coordinate(0) == 0);
	for (double s = 0.001; s < 1000; s *= 2) {
		double w = forward_depth_coordinate(s);
		assert_true(w > 0 && w < 1);
		assert_relative(forward_depth_at(w), s, 1e-9);
	}
}

/* Integrals of both tables over the sphere, and of blur times the cosine, for one depth. Angles as nodes of the trapezoidal rule. */
static double peak_flux(int depth, int band)
{
	double sum = 0;
	for (int i = 0; i + 1 < FORWARD_ANGLE_COUNT; i++) {
		double low = peak_angle(i), high = peak_angle(i + 1);
		sum += M_PI * (high - low) * (sin(low) * tables.peak[depth][i][band] + sin(high) * tables.peak[depth][i + 1][band]);
	}
	return sum;
}

static double blur_mean(int depth, int band, int power)
{
	double sum = 0;
	for (int i = 0; i < BLUR_ANGLE_COUNT; i++)
		sum += sin(blur_angle(i)) * pow(cos(blur_angle(i)), power) * tables.blur[depth][i][band];
	return sum * M_PI / (BLUR_ANGLE_COUNT - 1) / 2;
}

static void fluxes_are_poisson(void **state)
{
	static const double dsd[][2] = {{2, 7}, {1, 1}, {1, 30}, {20, 10}};
	for (int k = 0; k < 4; k++) {
		struct optics *optics = make(state, dsd[k][0], dsd[k][1]);
		for (int depth = 0; depth < FORWARD_DEPTH_COUNT; depth++)
			for (int band = 0; band < BAND_COUNT; band++) {
				double s = depth_at(depth), y = optics->forward_peak_fraction[band] * s, none = exp(-y);
				/* All that is not none or one event; float has no numbers for the largest depths. */
				double expected = exp(-s) * (expm1(y) - y);
				if (expected > 1e-30)
					assert_relative(peak_flux(depth, band), expected, s < 20 ? 2e-3 : 0.02);
				assert_float_equal(blur_mean(depth, band, 0), 1 - none, 1e-3);
				double forward = optics->moment_forward[band][1], modified = optics->moment_modified[band][1];
				double cosine = modified * (exp(-y * (1 - forward)) - none);
				assert_float_equal(blur_mean(depth, band, 1), cosine, 1e-3);
			}
		optics_destroy(optics);
	}
}

static void never_negative(void **state)
{
	static const double dsd[][2] = {{1, 1}, {20, 1}, {1, 30}, {20, 30}, {2, 7}};
	for (int k = 0; k < 5; k++) {
		struct optics *optics = make(state, dsd[k][0], dsd[k][1]);
		for (int depth = 0; depth < FORWARD_DEPTH_COUNT; depth++)
			for (int band = 0; band < BAND_COUNT; band++) {
				double top = tables.peak[depth][0][band];
				for (int i = 0; i < FORWARD_ANGLE_COUNT; i++) {
					double value = tables.peak[depth][i][band];
					assert_true(value >= 0 && value <= 1.0001 * top);
				}
				for (int i = 0; i < BLUR_ANGLE_COUNT; i++)
					assert_true(tables.blur[depth][i][band] >= 0 && tables.blur[depth][i][band] < 1000);
			}
		optics_destroy(optics);
	}
}

/* Ringing would show beyond the reach of the peak: two events end at 10 degrees, and the rest falls without rising again. */
static void no_ringing(void **state)
{
	struct optics *optics = make(state, 2, 7);
	for (int depth = 0; depth < FORWARD_DEPTH_COUNT; depth += 3) {
		double top = tables.peak[depth][0][1];
		for (int i = 1; i < FORWARD_ANGLE_COUNT; i++)
			assert_true(tables.peak[depth][i][1] <= tables.peak[depth][i - 1][1] + 2e-6 * top);
	}
	/* At the smallest depth three events are rare. */
	for (int i = 0; i < FORWARD_ANGLE_COUNT; i++)
		if (peak_angle(i) > 2.1 * FORWARD_PEAK_ANGLE)
			assert_true(tables.peak[0][i][1] < 1e-5 * tables.peak[0][0][1]);
	optics_destroy(optics);
}

/* P_F convolved with itself by brute force over the sphere. */
static double peak_twice(const struct optics *optics, int band, double angle)
{
	enum { AZIMUTHS = 400 };
	double fraction = optics->forward_peak_fraction[band], sum = 0;
	for (int i = 0; i < optics->forward_count; i++) {
		double inner = 0;
		for (int j = 0; j < AZIMUTHS; j++) {
			double turn = cos((j + 0.5) * M_PI / AZIMUTHS);
			double to = acos(fmin(cos(angle) * cos(optics->angle[i]) + sin(angle) * sin(optics->angle[i]) * turn, 1));
			if (to < FORWARD_PEAK_ANGLE)
				inner += optics_phase(optics, band, to) / AZIMUTHS;
		}
		sum += optics->weight[i] / 2 * optics->phase[band][i] * inner;
	}
	return sum / (fraction * fraction);
}

/* In a thin layer nearly all light of the first table has exactly two events: exp(-s) y^2/2 P_F*P_F / (4 pi), and a little more with
 * three, which reach further. */
static void two_events(void **state)
{
	struct optics *optics = make(state, 2, 7);
	double s = depth_at(0), y = s * optics->forward_peak_fraction[1];
	for (int i = 0; i < FORWARD_ANGLE_COUNT && peak_angle(i) < 1.5 * FORWARD_PEAK_ANGLE; i += 8) {
		double twice = exp(-s) * y * y / 2 * peak_twice(optics, 1, peak_angle(i)) / (4 * M_PI);
		double found = tables.peak[0][i][1];
		if (!(found > 0.995 * twice && found < (1 + 2 * y) * twice))
			fail_msg("%g instead of %g at %g degrees", found, twice, peak_angle(i) * 180 / M_PI);
	}
	optics_destroy(optics);
}

/* P_S blurred by one event, by brute force, in a thin layer: where P_S is smooth it stays itself. */
static void blur_of_smooth_part(void **state)
{
	struct optics *optics = make(state, 2, 7);
	double y = depth_at(0) * optics->forward_peak_fraction[1], kept = 1 - optics->forward_peak_fraction[1];
	for (int i = 0; i < BLUR_ANGLE_COUNT; i++) {
		double degrees = blur_angle(i) * 180 / M_PI;
		if (degrees < 30 || degrees > 120)
			continue;
		double expected = optics_phase(optics, 1, blur_angle(i)) / kept * (1 - exp(-y));
		assert_relative(tables.blur[0][i][1], expected, 0.03);
	}
	/* Inside the peak P_S is 0 and only light from outside comes in; the edge is left and right of the half value. */
	double outside = tables.blur[0][9][1], middle = tables.blur[0][7][1], inside = tables.blur[0][1][1];
	assert_true(inside < 0.2 * outside && middle > inside && middle < outside);
	optics_destroy(optics);
}

static int load_kernel(void **state)
{
	const char *path = getenv("STRATUS_KERNEL");
	*state = kernel_load(path ? path : "build/mie.kernel");
	return *state ? 0 : -1;
}

static int unload_kernel(void **state)
{
	kernel_destroy(*state);
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(depth_coordinate), cmocka_unit_test(fluxes_are_poisson), cmocka_unit_test(never_negative),
		cmocka_unit_test(no_ringing),       cmocka_unit_test(two_events),         cmocka_unit_test(blur_of_smooth_part),
	};
	return cmocka_run_group_tests(tests, load_kernel, unload_kernel);
}
