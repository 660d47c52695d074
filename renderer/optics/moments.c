/* Both directions fold the sphere at 90 degrees: P_l(-mu) = (-1)^l P_l(mu), so each Legendre function is made for half the angles.
 *
 * The kernel's angles resolve P, but not P_l for large l: over the body's panel P_1000 turns 236 times. P is therefore carried to a finer
 * grid there first, by sextic interpolation of its logarithm. Within 5 degrees of both ends the kernel's own nodes suffice to l = 2500. */
#include "renderer/optics/moments.h"

#include "renderer/optics/quadrature.h"

#include <math.h>
#include <pthread.h>
#include <string.h>

enum {
	FINE_COUNT = 1536, /* Gauss-Legendre needs pi nodes a turn, and P_2047 turns 483 times */
	STENCIL = 6,
	PEAK_SIZE = KERNEL_PEAK_COUNT + KERNEL_PEAK_COUNT % 2, /* vectors of two: padded to even with weight 0 */
	HALF_SIZE = PEAK_SIZE + FINE_COUNT
};

/* Native on every 64-bit machine; wider ones would be lowered to memory. */
typedef double pair __attribute__((vector_size(16), may_alias));

/* Angles of half the sphere, peak first; the same for all distributions. */
struct grid {
	_Alignas(16) double mu[HALF_SIZE];
	double weight[HALF_SIZE]; /* in mu */
	int first[FINE_COUNT];    /* of the stencil among the body's nodes */
	double stencil[FINE_COUNT][STENCIL];
};

/* What multiplies P_l(mu) at each angle: weights times P, folded; forward keeps its values apart from the rest. */
struct folded {
	_Alignas(16) double even[BAND_COUNT][HALF_SIZE];
	_Alignas(16) double odd[BAND_COUNT][HALF_SIZE];
	_Alignas(16) double forward[BAND_COUNT][PEAK_SIZE];
};

static struct grid grid;
static pthread_once_t grid_once = PTHREAD_ONCE_INIT;

/* Lagrange's coefficients at t of the nodes around it. */
static void fill_stencil(const double *node, double t, int *first, double *coefficient)
{
	int i = 0;
	while (i < KERNEL_BODY_COUNT && node[i] < t)
		i++;
	i -= STENCIL / 2;
	*first = i = i < 0 ? 0 : i > KERNEL_BODY_COUNT - STENCIL ? KERNEL_BODY_COUNT - STENCIL : i;
	for (int a = 0; a < STENCIL; a++) {
		coefficient[a] = 1;
		for (int b = 0; b < STENCIL; b++)
			if (b != a)
				coefficient[a] *= (t - node[i + b]) / (node[i + a] - node[i + b]);
	}
}

static void fill_grid(void)
{
	double node[FINE_COUNT], weight[FINE_COUNT], body[KERNEL_BODY_COUNT], unused[KERNEL_BODY_COUNT], slope;
	quadrature_gauss(KERNEL_PEAK_COUNT, node, weight);
	for (int i = 0; i < KERNEL_PEAK_COUNT; i++) {
		double angle = kernel_panel_angle(true, node[i], &slope);
		grid.mu[i] = cos(angle);
		grid.weight[i] = weight[i] * slope * sin(angle);
	}
	quadrature_gauss(KERNEL_BODY_COUNT, body, unused);
	quadrature_gauss(FINE_COUNT, node, weight);
	for (int i = 0; i < FINE_COUNT; i++) {
		double angle = kernel_panel_angle(false, node[i], &slope);
		grid.mu[PEAK_SIZE + i] = cos(angle);
		grid.weight[PEAK_SIZE + i] = weight[i] * slope * sin(angle);
		fill_stencil(body, node[i], &grid.first[i], grid.stencil[i]);
	}
}

/* P at a fine angle of the front half (mirror false) or the back half. */
static double fine_value(const double *log_phase, int i, bool mirror)
{
	double sum = 0;
	for (int a = 0; a < STENCIL; a++) {
		int pair_index = 1 + KERNEL_PEAK_COUNT + grid.first[i] + a;
		sum += grid.stencil[i][a] * log_phase[mirror ? KERNEL_ANGLE_COUNT - 1 - pair_index : pair_index];
	}
	return exp(sum);
}

static void fold(const double *phase, int band, struct folded *folded)
{
	for (int i = 0; i < KERNEL_PEAK_COUNT; i++) {
		double back = grid.weight[i] * phase[KERNEL_ANGLE_COUNT - 2 - i];
		folded->forward[band][i] = grid.weight[i] * phase[1 + i];
		folded->even[band][i] = back;
		folded->odd[band][i] = -back;
	}
	double log_phase[KERNEL_ANGLE_COUNT];
	for (int i = 0; i < KERNEL_ANGLE_COUNT; i++)
		log_phase[i] = log(phase[i]);
	for (int i = 0; i < FINE_COUNT; i++) {
		double front = fine_value(log_phase, i, false), back = fine_value(log_phase, i, true);
		folded->even[band][PEAK_SIZE + i] = grid.weight[PEAK_SIZE + i] * (front + back);
		folded->odd[band][PEAK_SIZE + i] = grid.weight[PEAK_SIZE + i] * (front - back);
	}
}

/* sum a[i] b[i]; count even. Two sums side by side, since the compiler may not reorder one. */
static double dot(const double *a, const double *b, int count)
{
	pair sum = {0, 0}, other = {0, 0};
	int i = 0;
	for (; i + 4 <= count; i += 4) {
		sum += *(const pair *)&a[i] * *(const pair *)&b[i];
		other += *(const pair *)&a[i + 2] * *(const pair *)&b[i + 2];
	}
	if (i < count)
		sum += *(const pair *)&a[i] * *(const pair *)&b[i];
	sum += other;
	return sum[0] + sum[1];
}

/* From P_(l-1) and P_l to P_l and P_(l+1), in place: before becomes the next, the caller swaps. */
static void legendre_advance(int l, const double *mu, const double *now, double *before, int count)
{
	double a = (2 * l + 1) / (l + 1.0), b = l / (l + 1.0);
	for (int i = 0; i < count; i++)
		before[i] = a * mu[i] * now[i] - b * before[i];
}

void moments_project(const double *const phase[BAND_COUNT], double *const forward[BAND_COUNT], double *const modified[BAND_COUNT])
{
	pthread_once(&grid_once, fill_grid);
	struct folded folded = {0};
	for (int band = 0; band < BAND_COUNT; band++)
		fold(phase[band], band, &folded);

	_Alignas(16) double legendre[2][HALF_SIZE];
	for (int i = 0; i < HALF_SIZE; i++) {
		legendre[0][i] = 1;
		legendre[1][i] = 0;
	}
	for (int l = 0; l < MOMENT_COUNT; l++) {
		double *now = legendre[l % 2], *before = legendre[(l + 1) % 2];
		for (int band = 0; band < BAND_COUNT; band++) {
			forward[band][l] = dot(folded.forward[band], now, PEAK_SIZE);
			modified[band][l] = dot(l % 2 ? folded.odd[band] : folded.even[band], now, HALF_SIZE);
		}
		legendre_advance(l, grid.mu, now, before, HALF_SIZE);
	}
	for (int band = 0; band < BAND_COUNT; band++)
		for (int l = MOMENT_COUNT - 1; l >= 0; l--) {
			forward[band][l] /= forward[band][0];
			modified[band][l] /= modified[band][0];
		}
}

void moments_expand(const double *angle, double coefficient[BAND_COUNT][MOMENT_COUNT], double *const result[BAND_COUNT])
{
	double mu[KERNEL_PAIR_COUNT], legendre[2][KERNEL_PAIR_COUNT], sum[2][BAND_COUNT][KERNEL_PAIR_COUNT];
	memset(sum, 0, sizeof sum);
	for (int i = 0; i < KERNEL_PAIR_COUNT; i++) {
		mu[i] = cos(angle[i]);
		legendre[0][i] = 1;
		legendre[1][i] = 0;
	}
	for (int l = 0; l < MOMENT_COUNT; l++) {
		double *now = legendre[l % 2], *before = legendre[(l + 1) % 2];
		for (int band = 0; band < BAND_COUNT; band++) {
			double factor = (2 * l + 1) * coefficient[band][l];
			for (int i = 0; i < KERNEL_PAIR_COUNT; i++)
				sum[l % 2][band][i] += factor * now[i];
		}
		legendre_advance(l, mu, now, before, KERNEL_PAIR_COUNT);
	}
	for (int band = 0; band < BAND_COUNT; band++)
		for (int i = 0; i < KERNEL_PAIR_COUNT; i++) {
			result[band][i] = sum[0][band][i] + sum[1][band][i];
			result[band][KERNEL_ANGLE_COUNT - 1 - i] = sum[0][band][i] - sum[1][band][i];
		}
}
