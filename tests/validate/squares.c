#include "tests/validate/squares.h"

#include "renderer/stages/exchange.h"

#include <math.h>
#include <stdlib.h>

double square_factor(double a, double x, double y)
{
	return exchange_corner_factor(a - x, a - y) + exchange_corner_factor(a + x, a - y) + exchange_corner_factor(a - x, a + y) +
	       exchange_corner_factor(a + x, a + y);
}

/* Images farther off are as good as uniform. */
double square_factor_periodic(double a, double x, double y, double tile)
{
	const int images = (int)fmin(60, 4 + 16 / tile);
	double sum = 0;
	for (int i = -images; i <= images; i++)
		for (int k = -images; k <= images; k++)
			sum += square_factor(a, x + i * tile, y + k * tile);
	return sum + (1 - square_factor((images + 0.5) * tile, 0, 0)) * (4 * a * a) / (tile * tile);
}

/* Linear between texels' centres. Place in texels. */
static double read_at(const float *values, int side, double x, double y)
{
	const int left = (int)floor(x - 0.5), low = (int)floor(y - 0.5);
	const double across = x - 0.5 - left, up = y - 0.5 - low;
	double sum = 0;
	for (int i = 0; i < 4; i++) {
		const int column = (left + i % 2 + 2 * side) % side, row = (low + i / 2 + 2 * side) % side;
		sum += (double)values[row * side + column] * (i % 2 ? across : 1 - across) * (i / 2 ? up : 1 - up);
	}
	return sum;
}

/* Share of texel i that lies within from..to. */
static double cover(int i, double from, double to)
{
	return fmax(0, fmin(i + 1, to) - fmax(i, from));
}

/* Of half-width a around (x, y), in texels; in the first band alone. */
static void put_square(float *values, int side, double a, double x, double y)
{
	for (int i = 0; i < EXCHANGE_BANDS * side * side; i++)
		values[i] = i < side * side ? (float)(cover(i % side, x - a, x + a) * cover(i / side, y - a, y + a)) : 0;
}

double square_error(double tile_m, double distance_m, double half_width, double *texel)
{
	static const double points[][2] = {{0, 0}, {1, 0}, {1, 1}, {1.5, 0}, {1.5, 1.5}, {2, 0.4}};
	const int side = exchange_side(tile_m, distance_m);
	float *kernel = exchange_kernel_create(side, tile_m, distance_m);
	float *values = malloc(EXCHANGE_BANDS * (size_t)side * (size_t)side * sizeof *values);
	struct exchange exchange = {0};
	double worst = -1;
	*texel = tile_m / side / distance_m;
	const bool fine = *texel <= 1 / EXCHANGE_TEXELS;
	const double a = fine ? fmin(half_width / *texel, 0.4 * side) : fmax(1, round(half_width / *texel));
	const double x = side / 2 + (fine ? 0.37 : 0), y = side / 2 - (fine ? 0.21 : 0);
	if (kernel && values && exchange_init(&exchange, side, kernel, (const double[]){0, 0})) {
		put_square(values, side, a, x, y);
		exchange_receive(&exchange, EXCHANGE_LEVEL, values, values);
		for (size_t p = 0; p < sizeof points / sizeof *points; p++) {
			const double u = points[p][0] * a, v = points[p][1] * a;
			const double wanted = square_factor_periodic(a * *texel, u * *texel, v * *texel, side * *texel);
			worst = fmax(worst, fabs(read_at(values, side, x + u, y + v) - wanted));
		}
	}
	exchange_finish(&exchange);
	free(values);
	free(kernel);
	return worst;
}
