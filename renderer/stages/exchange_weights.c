#include "renderer/stages/exchange_weights.h"

#include <math.h>
#include <string.h>

/* Modified Bessel function K_1 for x > 0: Abramowitz and Stegun 9.8.7 and 9.8.8, absolute error of x K_1 below 1e-7. */
static double bessel_k1(double x)
{
	if (x <= 2) {
		const double y = x * x / 4, t = x / 3.75, u = t * t;
		const double i1 =
			x * (0.5 +
			     u * (0.87890594 + u * (0.51498869 + u * (0.15084934 + u * (0.02658733 + u * (0.00301532 + u * 0.00032411))))));
		return log(x / 2) * i1 +
		       (1 +
			y * (0.15443144 + y * (-0.67278579 + y * (-0.18156897 + y * (-0.01919402 + y * (-0.00110404 - y * 0.00004686)))))) /
			       x;
	}
	const double y = 2 / x;
	return exp(-x) / sqrt(x) *
	       (1.25331414 +
		y * (0.23498619 + y * (-0.03655620 + y * (0.01504268 + y * (-0.00780353 + y * (0.00325614 - y * 0.00068245))))));
}

double exchange_kernel_transform(double wave_number_per_m, double distance_m)
{
	const double x = wave_number_per_m * distance_m;
	return x < 1e-6 ? 1 : x > 80 ? 0 : x * bessel_k1(x);
}

static double sinc(double x)
{
	return fabs(x) < 1e-6 ? 1 : sin(x) / x;
}

/* Along one axis, at half a wave's phase over a texel of level 0. Each reduction is (1 + 1)^3/8, whose transform is the cube of a cosine;
 * the product of the cosines up to a level is a ratio of two sinc. */
static double axis_transform(double half, int level)
{
	const double box = sinc(half), read = sinc(half * (1 << level)), reduced = fabs(box) > 1e-9 ? read / box : 0;
	return box * reduced * reduced * reduced * read * read * read * read;
}

double exchange_level_transform(double wave_number_per_m, double texel_m, int level)
{
	enum { DIRECTIONS = 8 };
	if (level == EXCHANGE_LEVELS - 1) /* the mean over the tile */
		return wave_number_per_m == 0;
	double sum = 0;
	for (int i = 0; i < DIRECTIONS; i++) {
		const double azimuth = (i + 0.5) * M_PI / 2 / DIRECTIONS, half = 0.5 * wave_number_per_m * texel_m;
		sum += axis_transform(half * cos(azimuth), level) * axis_transform(half * sin(azimuth), level);
	}
	return sum / DIRECTIONS;
}

/* The last level, the mean, has no waves: it takes what the others leave of the sum, and is not fitted. */
enum { WAVES = 96, FITTED = EXCHANGE_LEVELS - 1 };

/* Non-negative least squares by coordinate descent on the normal equations, which are small and well scaled. */
static void solve_nonnegative(const double matrix[FITTED][FITTED], const double right[FITTED], double solution[FITTED])
{
	memset(solution, 0, FITTED * sizeof *solution);
	for (int sweep = 0; sweep < 20000; sweep++) {
		double change = 0;
		for (int i = 0; i < FITTED; i++) {
			double rest = right[i];
			for (int j = 0; j < FITTED; j++)
				rest -= j == i ? 0 : matrix[i][j] * solution[j];
			const double next = fmax(0, rest / matrix[i][i]);
			change = fmax(change, fabs(next - solution[i]));
			solution[i] = next;
		}
		if (change < 1e-10)
			break;
	}
}

void exchange_weights(double tile_m, double distance_m, double weights[EXCHANGE_LEVELS])
{
	const double texel_m = tile_m / EXCHANGE_SIDE;
	double matrix[FITTED][FITTED] = {{0}}, right[FITTED] = {0};
	for (int w = 0; w < WAVES; w++) {
		/* From the tile's own wave number to that of two texels, evenly in its logarithm. */
		const double k = 2 * M_PI / tile_m * pow(EXCHANGE_SIDE / 2.0, (double)w / (WAVES - 1));
		const double wanted = exchange_kernel_transform(k, distance_m);
		/* Waves of a square emitter fall off as k^-3/2, and their number grows with k: long ones count most. */
		const double importance = pow(k * tile_m / (2 * M_PI), -1.5);
		double basis[FITTED];
		for (int i = 0; i < FITTED; i++)
			basis[i] = exchange_level_transform(k, texel_m, i);
		for (int i = 0; i < FITTED; i++) {
			right[i] += importance * basis[i] * wanted;
			for (int j = 0; j < FITTED; j++)
				matrix[i][j] += importance * basis[i] * basis[j];
		}
	}
	solve_nonnegative(matrix, right, weights);
	double sum = 0;
	for (int i = 0; i < FITTED; i++)
		sum += weights[i];
	weights[FITTED] = fmax(0, 1 - sum);
	for (int i = 0; sum > 1 && i < FITTED; i++)
		weights[i] /= sum;
}
