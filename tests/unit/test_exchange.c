/* Exchange of light between parallel planes: the transform against its definition, the kernel against its own transform's closed form,
 * squares against their form factor at every ratio of tile, texel and distance that a scene may have. */
#include "renderer/stages/exchange.h"
#include "tests/validate/squares.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { TEXELS_MAX = EXCHANGE_SIDE_MAX * EXCHANGE_SIDE_MAX };

static uint32_t random_state = 2006;

static float random_unit(void)
{
	random_state = random_state * 1664525u + 1013904223u;
	return (float)(random_state >> 8) / (float)(1 << 24);
}

/* --- the transform --------------------------------------------------------------------------------------------------------------- */

static void transform_is_the_sum_it_says(void **state)
{
	(void)state;
	enum { SIDE = 16 };
	float re[SIDE * SIDE], im[SIDE * SIDE], given[2][SIDE * SIDE];
	struct fourier fourier;
	fourier_init(&fourier, SIDE);
	for (int i = 0; i < SIDE * SIDE; i++) {
		given[0][i] = re[i] = random_unit();
		given[1][i] = im[i] = random_unit();
	}
	fourier_forward(&fourier, re, im);
	for (int row = 0; row < SIDE; row++)
		for (int column = 0; column < SIDE; column++) {
			const int kx = fourier_frequency(SIDE, row), ky = fourier_frequency(SIDE, column);
			double wanted[2] = {0};
			for (int i = 0; i < SIDE * SIDE; i++) {
				const double phase = -2 * M_PI * (kx * (i % SIDE) + ky * (i / SIDE)) / SIDE;
				wanted[0] += (double)given[0][i] * cos(phase) - (double)given[1][i] * sin(phase);
				wanted[1] += (double)given[1][i] * cos(phase) + (double)given[0][i] * sin(phase);
			}
			assert_float_equal(re[row * SIDE + column], wanted[0], 1e-3);
			assert_float_equal(im[row * SIDE + column], wanted[1], 1e-3);
		}
}

static void transforms_come_back(void **state)
{
	(void)state;
	static float re[TEXELS_MAX], im[TEXELS_MAX], given[TEXELS_MAX];
	for (int side = 2; side <= FOURIER_SIDE_MAX; side *= 2) {
		struct fourier fourier;
		fourier_init(&fourier, side);
		for (int i = 0; i < side * side; i++) {
			given[i] = re[i] = random_unit();
			im[i] = 1 - re[i];
		}
		fourier_forward(&fourier, re, im);
		fourier_inverse(&fourier, re, im);
		for (int i = 0; i < side * side; i++) {
			assert_float_equal(re[i] / (float)(side * side), given[i], 1e-5);
			assert_float_equal(im[i] / (float)(side * side), 1 - given[i], 1e-5);
		}
	}
}

/* --- the kernel ------------------------------------------------------------------------------------------------------------------ */

/* Hankel transform of h^2/(pi (h^2 + d^2)^2) for h = 1; with s = d^2/(1 + d^2) the kernel's mass is uniform in s. Its closed form is
 * k K_1(k): K_1(1) = 0.6019072302, 2 K_1(2) = 0.2797317636 (Abramowitz and Stegun, table 9.8). */
static double kernel_transform(double k)
{
	enum { STEPS = 3000 };
	double sum = 0;
	for (int i = 0; i < STEPS; i++) {
		const double s = (i + 0.5) / STEPS;
		sum += j0(k * sqrt(s / (1 - s))) / STEPS;
	}
	return sum;
}

static double sinc(double x)
{
	return fabs(x) < 1e-9 ? 1 : sin(x) / x;
}

/* Along one axis, where texels much smaller than h make the sum an integral: the kernel's transform, times that of a texel. */
static void kernel_has_its_transform(void **state)
{
	(void)state;
	static const double tiles[] = {3, 8, 20, 40}; /* over h */
	assert_float_equal(kernel_transform(1), 0.6019072302, 5e-4);
	assert_float_equal(kernel_transform(2), 0.2797317636, 5e-4);
	for (size_t i = 0; i < sizeof tiles / sizeof *tiles; i++) {
		const int side = exchange_side(1000 * tiles[i], 1000);
		float *kernel = exchange_kernel_create(side, 1000 * tiles[i], 1000);
		assert_non_null(kernel);
		for (int row = 0; row < side; row++) {
			const int waves = fourier_frequency(side, row);
			const double k = 2 * M_PI * abs(waves) / tiles[i];
			if (k > 7)
				continue;
			const double wanted = kernel_transform(k) * sinc(M_PI * waves / side);
			assert_float_equal(kernel[row * side] * (float)side * (float)side, wanted, 1e-3);
		}
		free(kernel);
	}
}

/* --- light ----------------------------------------------------------------------------------------------------------------------- */

struct planes {
	int side;
	double tile, h;
	float *kernel, *values;
	struct exchange exchange;
};

static struct planes planes_make(double tile, double h, double east, double north)
{
	struct planes planes = {.side = exchange_side(tile, h), .tile = tile, .h = h};
	planes.kernel = exchange_kernel_create(planes.side, tile, h);
	planes.values = calloc(EXCHANGE_BANDS * TEXELS_MAX, sizeof *planes.values);
	assert_non_null(planes.kernel);
	assert_non_null(planes.values);
	assert_true(exchange_init(&planes.exchange, planes.side, planes.kernel, (const double[]){east, north}));
	return planes;
}

static void planes_free(struct planes *planes)
{
	exchange_finish(&planes->exchange);
	free(planes->kernel);
	free(planes->values);
}

/* As the view reads it: linear between texels' centres. Place in texels. */
static double read_at(const struct planes *planes, int band, double x, double y)
{
	const int side = planes->side, left = (int)floor(x - 0.5), low = (int)floor(y - 0.5);
	const double across = x - 0.5 - left, up = y - 0.5 - low;
	double sum = 0;
	for (int i = 0; i < 4; i++) {
		const int column = (left + i % 2 + 2 * side) % side, row = (low + i / 2 + 2 * side) % side;
		sum += (double)planes->values[(band * side + row) * side + column] * (i % 2 ? across : 1 - across) * (i / 2 ? up : 1 - up);
	}
	return sum;
}

/* Share of texel i that lies within from..to. */
static double cover(int i, double from, double to)
{
	return fmax(0, fmin(i + 1, to) - fmax(i, from));
}

/* A square of half-width a around (x, y), in texels, in all bands with different values. */
static void put_square(struct planes *planes, double a, double x, double y)
{
	const int side = planes->side;
	for (int band = 0; band < EXCHANGE_BANDS; band++)
		for (int i = 0; i < side * side; i++)
			planes->values[band * side * side + i] =
				(float)((band + 1) * cover(i % side, x - a, x + a) * cover(i / side, y - a, y + a));
}

static void analytic_values_are_known(void **state)
{
	(void)state;
	/* Centred squares of half-width h/2, h, 2h, 4h, 8h. */
	static const double halves[] = {0.5, 1, 2, 4, 8}, wanted[] = {0.239, 0.554, 0.831, 0.951, 0.987};
	for (int i = 0; i < 5; i++)
		assert_float_equal(square_factor(halves[i], 0, 0), wanted[i], 6e-4);
}

static const double tiles_m[] = {2000, 20000, 63000, 200000}, bases_m[] = {100, 350, 1200, 4000, 12000};
/* Whatever the ratio of texel and distance, squares made of whole texels are exact in front of the texels' centres. */
static void squares_of_texels_are_exact(void **state)
{
	(void)state;
	for (size_t t = 0; t < sizeof tiles_m / sizeof *tiles_m; t++)
		for (size_t b = 0; b < sizeof bases_m / sizeof *bases_m; b++) {
			struct planes planes = planes_make(tiles_m[t], bases_m[b], 0, 0);
			const int side = planes.side;
			const double texel = tiles_m[t] / side / bases_m[b];
			double worst = 0;
			for (int a = 1; a <= side / 4; a *= 4) {
				put_square(&planes, a, side / 2, side / 2);
				exchange_receive(&planes.exchange, EXCHANGE_LEVEL, planes.values, planes.values);
				for (int band = 0; band < EXCHANGE_BANDS; band++)
					for (int i = 0; i < 24; i++) {
						const int x = side / 2 + (i * side / 48), y = side / 2 + i % 5 * side / 16;
						const double wanted = square_factor_periodic(a * texel, (x + 0.5 - side / 2) * texel,
											     (y + 0.5 - side / 2) * texel, side * texel);
						const double found = (double)planes.values[(band * side + y) * side + x] / (band + 1);
						worst = fmax(worst, fabs(found - wanted));
					}
			}
			assert_true(worst < 1e-3);
			planes_free(&planes);
		}
}

/* As the view reads them. Where h has 3.2 texels or more, squares of any size and place are at most 2 % of the emitter's value off.
 * Larger texels hold squares of whole texels alone, and what is read between their centres is linear where light is not. */
static void squares_have_their_form_factor(void **state)
{
	(void)state;
	static const double halves[] = {0.5, 1, 2, 4, 8, 16};
	for (size_t t = 0; t < sizeof tiles_m / sizeof *tiles_m; t++)
		for (size_t b = 0; b < sizeof bases_m / sizeof *bases_m; b++) {
			double worst = 0, texel = 0;
			for (size_t i = 0; i < sizeof halves / sizeof *halves; i++) {
				const double error = square_error(tiles_m[t], bases_m[b], halves[i], &texel);
				assert_true(error >= 0);
				worst = fmax(worst, error);
			}
			print_message("tile %6.0f m, base %5.0f m: texels of %.3f h, squares off by at most %.4f\n", tiles_m[t], bases_m[b],
				      texel, worst);
			assert_true(worst <= (texel <= 1 / EXCHANGE_TEXELS ? 0.02 : 0.13));
		}
}

/* Tiles of 5 to 160 heights of the base, none of which divides a texel evenly: at the centre, the edge, the corner and outside. */
static void squares_hold_up_to_tiles_of_160_heights(void **state)
{
	(void)state;
	static const double ratios[] = {5, 17, 40, 85, 120, 160}, halves[] = {0.5, 0.7, 1, 2, 3.3, 8};
	for (size_t r = 0; r < sizeof ratios / sizeof *ratios; r++) {
		double worst = 0, texel = 0;
		for (size_t i = 0; i < sizeof halves / sizeof *halves; i++)
			worst = fmax(worst, square_error(1000 * ratios[r], 1000, halves[i], &texel));
		print_message("tile of %3.0f h: texels of %.3f h, squares off by at most %.4f\n", ratios[r], texel, worst);
		assert_true(texel <= 1 / EXCHANGE_TEXELS);
		assert_true(worst <= 0.02);
	}
}

static double mean_of(const float *values, int count)
{
	double sum = 0;
	for (int i = 0; i < count; i++)
		sum += (double)values[i];
	return sum / count;
}

static void nothing_is_created_or_lost(void **state)
{
	(void)state;
	for (size_t t = 0; t < sizeof tiles_m / sizeof *tiles_m; t++)
		for (size_t b = 0; b < sizeof bases_m / sizeof *bases_m; b++) {
			struct planes planes = planes_make(tiles_m[t], bases_m[b], 0.137, 0.731);
			const int count = planes.side * planes.side;
			for (int i = 0; i < EXCHANGE_BANDS * count; i++)
				planes.values[i] = random_unit() < 0.05f ? 1000 * random_unit() : 1;
			const double before = mean_of(planes.values, count);
			exchange_receive(&planes.exchange, EXCHANGE_LEVEL, planes.values, planes.values);
			assert_float_equal(mean_of(planes.values, count) / before, 1, 1e-5);
			for (int i = 0; i < EXCHANGE_BANDS * count; i++)
				assert_true(planes.values[i] > 0);
			exchange_receive(&planes.exchange, EXCHANGE_DOWN, planes.values, planes.values);
			assert_float_equal(mean_of(planes.values, count) / before, 1, 1e-5);
			planes_free(&planes);
		}
}

/* Clouds that have drifted send to where they are now, and receive from there. */
static void drift_moves_the_base(void **state)
{
	(void)state;
	const double tile = 20000, h = 1200;
	for (int i = 0; i < 12; i++) {
		struct planes planes = planes_make(tile, h, i * 0.0713, -i * 0.0391);
		const int side = planes.side;
		const double texel = tile / side / h, x = side / 2 + i * 0.0713 * side, y = side / 2 - i * 0.0391 * side;
		double worst = 0;
		for (int up = 0; up < 2; up++) {
			if (up)
				put_square(&planes, 5, side / 2 + 0.4, side / 2 + 0.2);
			else
				put_square(&planes, 5, side / 2, side / 2);
			exchange_receive(&planes.exchange, up ? EXCHANGE_UP : EXCHANGE_DOWN, planes.values, planes.values);
			for (double u = -9; u < 9; u += 0.7) {
				const double at_x = up ? side + 0.4 - x : x, at_y = up ? side + 0.2 - y : y;
				const double found =
					read_at(&planes, 2, fmod(at_x + u + 2 * side, side), fmod(at_y + u / 2 + 2 * side, side));
				worst = fmax(worst,
					     fabs(found / 3 - square_factor_periodic(5 * texel, u * texel, u / 2 * texel, side * texel)));
			}
		}
		assert_true(worst < 0.012);
		planes_free(&planes);
	}
}

/* What one place sends another comes back the same way: the solver counts on it. */
static void ways_down_and_up_are_the_same(void **state)
{
	(void)state;
	static float u[EXCHANGE_BANDS * TEXELS_MAX], v[EXCHANGE_BANDS * TEXELS_MAX], ku[EXCHANGE_BANDS * TEXELS_MAX],
		kv[EXCHANGE_BANDS * TEXELS_MAX];
	struct planes planes = planes_make(20000, 900, 0.3117, 0.9043);
	const int count = EXCHANGE_BANDS * planes.side * planes.side;
	double down = 0, up = 0;
	for (int i = 0; i < count; i++) {
		u[i] = random_unit() - 0.5f;
		v[i] = random_unit() - 0.5f;
	}
	exchange_receive(&planes.exchange, EXCHANGE_DOWN, u, ku);
	exchange_receive(&planes.exchange, EXCHANGE_UP, v, kv);
	for (int i = 0; i < count; i++) {
		down += (double)(ku[i] * v[i]);
		up += (double)(u[i] * kv[i]);
	}
	assert_true(fabs(down) > 0.1);
	assert_float_equal(down, up, 1e-4);
	planes_free(&planes);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(transform_is_the_sum_it_says),
		cmocka_unit_test(transforms_come_back),
		cmocka_unit_test(kernel_has_its_transform),
		cmocka_unit_test(analytic_values_are_known),
		cmocka_unit_test(squares_of_texels_are_exact),
		cmocka_unit_test(squares_have_their_form_factor),
		cmocka_unit_test(nothing_is_created_or_lost),
		cmocka_unit_test(drift_moves_the_base),
		cmocka_unit_test(squares_hold_up_to_tiles_of_160_heights),
		cmocka_unit_test(ways_down_and_up_are_the_same),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
