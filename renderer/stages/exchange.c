#include "renderer/stages/exchange.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

int exchange_side(double tile_m, double distance_m)
{
	int side = EXCHANGE_SIDE_MIN;
	while (side < EXCHANGE_SIDE_MAX && side < EXCHANGE_TEXELS * tile_m / distance_m)
		side *= 2;
	return side;
}

double exchange_corner_factor(double x, double y)
{
	const double a = sqrt(1 + x * x), b = sqrt(1 + y * y);
	return (x / a * atan(y / a) + y / b * atan(x / b)) / (2 * M_PI);
}

/* Factors of rectangles with corners at half texels, texels 0 .. reach: (reach + 1)^2 of them. */
static double *corner_factors(int reach, double texel)
{
	const int count = reach + 1;
	double *corners = malloc((size_t)count * (size_t)count * sizeof *corners);
	for (int y = 0; corners && y < count; y++)
		for (int x = 0; x <= y; x++)
			corners[y * count + x] = corners[x * count + y] = exchange_corner_factor((x + 0.5) * texel, (y + 0.5) * texel);
	return corners;
}

/* Of the texel at (x, y), both >= 0, from the point in front of texel 0. */
static double texel_factor(const double *corners, int count, int x, int y)
{
	const double *above = corners + y * count, *below = y > 0 ? above - count : above;
	const double low = y > 0 ? -1 : 1; /* the factors are odd */
	const double right = above[x] + low * below[x], left = x > 0 ? above[x - 1] + low * below[x - 1] : -right;
	return right - left;
}

/* Adds up the texels' periods as far as `periods` each way. What lies beyond is as good as uniform. */
static void fill_factors(float *factors, int side, const double *corners, int periods)
{
	const int reach = periods * side + side / 2, count = reach + 1;
	double rest = 1;
	for (int y = 0; y < side; y++)
		for (int x = 0; x < side; x++) {
			double sum = 0;
			for (int row = y - reach; row < reach; row += side)
				for (int column = x - reach; column < reach; column += side)
					sum += texel_factor(corners, count, abs(column), abs(row));
			/* (0, 0) stands half a tile off. */
			factors[(y + side / 2) % side * side + (x + side / 2) % side] = (float)sum;
			rest -= sum;
		}
	for (int i = 0; i < side * side; i++)
		factors[i] += (float)(rest / side / side);
}

float *exchange_kernel_create(int side, double tile_m, double distance_m)
{
	const double height = distance_m / tile_m;
	const int count = side * side;
	/* Beyond eight distances lies 1.5 % of a plane's light; at two tiles the longest wave is down to 2e-5. */
	const int periods = height > 2 ? 0 : (int)fmax(1, ceil(8 * height));
	float *kernel = calloc(2 * (size_t)count, sizeof *kernel);
	double *corners = corner_factors(periods * side + side / 2, 1 / (side * height));
	if (!kernel || !corners) {
		free(kernel);
		free(corners);
		return NULL;
	}
	if (height > 2) {
		for (int i = 0; i < count; i++)
			kernel[i] = 1.0f / (float)count;
	} else {
		fill_factors(kernel, side, corners, periods);
	}
	free(corners);
	struct fourier fourier;
	fourier_init(&fourier, side);
	fourier_forward(&fourier, kernel, kernel + count); /* real, as the factors are symmetric */
	for (int i = 0; i < count; i++)
		kernel[i] /= (float)count;
	return kernel;
}

bool exchange_init(struct exchange *exchange, int side, const float *kernel, const double drift[2])
{
	exchange->kernel = kernel;
	exchange->scratch = calloc(4 * (size_t)side * (size_t)side, sizeof *exchange->scratch);
	fourier_init(&exchange->fourier, side);
	for (int axis = 0; axis < 2; axis++)
		for (int i = 0; i < side; i++) {
			const int waves = fourier_frequency(side, i);
			const double phase = 2 * M_PI * waves * drift[axis];
			exchange->shift[axis][0][i] = (float)cos(phase);
			/* The finest wave stands for both directions, and must stay real. */
			exchange->shift[axis][1][i] = 2 * abs(waves) == side ? 0 : (float)-sin(phase);
		}
	return exchange->scratch;
}

void exchange_finish(struct exchange *exchange)
{
	free(exchange->scratch);
	exchange->scratch = NULL;
}

/* sign: 1 moves with the drift, -1 against it, 0 not at all. */
static void multiply(const struct exchange *exchange, float sign, float *restrict re, float *restrict im)
{
	const int side = exchange->fourier.side;
	for (int row = 0; row < side; row++) {
		const float *kernel = exchange->kernel + row * side, *y_re = exchange->shift[1][0], *y_im = exchange->shift[1][1];
		const float x_re = exchange->shift[0][0][row], x_im = exchange->shift[0][1][row];
		for (int i = 0; i < side; i++) {
			const int at = row * side + i;
			const float shift_re = sign == 0 ? 1 : x_re * y_re[i] - x_im * y_im[i];
			const float shift_im = sign * (x_re * y_im[i] + x_im * y_re[i]);
			const float value_re = kernel[i] * re[at], value_im = kernel[i] * im[at];
			re[at] = value_re * shift_re - value_im * shift_im;
			im[at] = value_im * shift_re + value_re * shift_im;
		}
	}
}

void exchange_receive(struct exchange *exchange, enum exchange_way way, const float *sends, float *received)
{
	static const float signs[] = {[EXCHANGE_DOWN] = 1, [EXCHANGE_UP] = -1, [EXCHANGE_LEVEL] = 0};
	const size_t count = (size_t)exchange->fourier.side * (size_t)exchange->fourier.side,
		     bytes = EXCHANGE_BANDS * count * sizeof *sends;
	float *scratch = exchange->scratch;
	/* Two real pictures make a complex one; the kernel is real and keeps them apart. The fourth is zero. */
	memcpy(scratch, sends, bytes);
	memset(scratch + EXCHANGE_BANDS * count, 0, count * sizeof *scratch);
	for (int pair = 0; pair < 2; pair++, scratch += 2 * count) {
		fourier_forward(&exchange->fourier, scratch, scratch + count);
		multiply(exchange, signs[way], scratch, scratch + count);
		fourier_inverse(&exchange->fourier, scratch, scratch + count);
	}
	memcpy(received, exchange->scratch, bytes);
}
