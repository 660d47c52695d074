#include "renderer/stages/fourier.h"

#include <math.h>

void fourier_init(struct fourier *fourier, int side)
{
	fourier->side = side;
	for (int i = 0; i < side / 2; i++) {
		fourier->cosine[i] = (float)cos(2 * M_PI * i / side);
		fourier->sine[i] = (float)sin(2 * M_PI * i / side);
	}
}

int fourier_frequency(int side, int index)
{
	int reversed = 0;
	for (int bit = 1; bit < side; bit *= 2)
		reversed = 2 * reversed + (index & bit ? 1 : 0);
	return reversed < side / 2 ? reversed : reversed - side;
}

/* Two rows a, b become a + b and (a - b) w, w = cosine - i sine. */
static void butterfly_forward(float *restrict a_re, float *restrict a_im, float *restrict b_re, float *restrict b_im, int count,
			      float cosine, float sine)
{
	for (int x = 0; x < count; x++) {
		const float re = a_re[x] - b_re[x], im = a_im[x] - b_im[x];
		a_re[x] += b_re[x];
		a_im[x] += b_im[x];
		b_re[x] = re * cosine + im * sine;
		b_im[x] = im * cosine - re * sine;
	}
}

/* The reverse, twice: a, b become a + b / w and a - b / w. */
static void butterfly_inverse(float *restrict a_re, float *restrict a_im, float *restrict b_re, float *restrict b_im, int count,
			      float cosine, float sine)
{
	for (int x = 0; x < count; x++) {
		const float re = b_re[x] * cosine - b_im[x] * sine, im = b_im[x] * cosine + b_re[x] * sine;
		b_re[x] = a_re[x] - re;
		b_im[x] = a_im[x] - im;
		a_re[x] += re;
		a_im[x] += im;
	}
}

/* Along columns, whole rows at a time. Forward by decimation in frequency, which leaves the rows in bit-reversed order, and back by
 * decimation in time, which starts from there: nobody has to sort them. */
static void columns_forward(const struct fourier *fourier, float *restrict re, float *restrict im)
{
	const int side = fourier->side;
	for (int half = side / 2; half > 0; half /= 2)
		for (int row = 0; row < side; row++) {
			const int at = row % half * (side / (2 * half)), a = row * side, b = a + half * side;
			if ((row & half) == 0)
				butterfly_forward(re + a, im + a, re + b, im + b, side, fourier->cosine[at], fourier->sine[at]);
		}
}

static void columns_inverse(const struct fourier *fourier, float *restrict re, float *restrict im)
{
	const int side = fourier->side;
	for (int half = 1; half < side; half *= 2)
		for (int row = 0; row < side; row++) {
			const int at = row % half * (side / (2 * half)), a = row * side, b = a + half * side;
			if ((row & half) == 0)
				butterfly_inverse(re + a, im + a, re + b, im + b, side, fourier->cosine[at], fourier->sine[at]);
		}
}

static void transpose(int side, float *values)
{
	enum { BLOCK = 8 }; /* lines of cache */
	const int block = side < BLOCK ? side : BLOCK;
	for (int row = 0; row < side; row += block)
		for (int column = 0; column <= row; column += block)
			for (int y = row; y < row + block; y++)
				for (int x = column; x < (column == row ? y : column + block); x++) {
					const float value = values[y * side + x];
					values[y * side + x] = values[x * side + y];
					values[x * side + y] = value;
				}
}

void fourier_forward(const struct fourier *fourier, float *re, float *im)
{
	columns_forward(fourier, re, im);
	transpose(fourier->side, re);
	transpose(fourier->side, im);
	columns_forward(fourier, re, im);
}

void fourier_inverse(const struct fourier *fourier, float *re, float *im)
{
	columns_inverse(fourier, re, im);
	transpose(fourier->side, re);
	transpose(fourier->side, im);
	columns_inverse(fourier, re, im);
}
