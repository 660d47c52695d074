/* Both tables are Legendre series in the scattering angle, one per depth and band, of coefficients that need one exponential each. The
 * sums are a matrix product [series][l] x [l][angle], made slice by slice of l with everything in the processor's caches. */
#include "renderer/optics/forward.h"

#include <math.h>
#include <string.h>

enum {
	SERIES_COUNT = FORWARD_DEPTH_COUNT * BAND_COUNT,
	HALF_COUNT = BLUR_ANGLE_COUNT / 2, /* of the blur's angles, the others being their mirror images */
	SLICE = 32,                        /* even, so that each slice begins with an even l */
	STRIP = 8                          /* angles whose sums stay in registers */
};

_Static_assert(FORWARD_ANGLE_COUNT % STRIP == 0 && HALF_COUNT % STRIP == 0 && BLUR_ANGLE_COUNT % 2 == 0, "angles come in whole strips");

/* P_l(mu) for a slice of l, with what continues the recurrence. */
struct legendre {
	double mu[HALF_COUNT], before[HALF_COUNT];
	double value[SLICE + 1][HALF_COUNT];
};

_Static_assert((int)FORWARD_ANGLE_COUNT == (int)HALF_COUNT, "struct legendre serves both sets of angles");

/* All that a computation needs, 0.5 MB of stack. */
struct workspace {
	struct legendre peak_angles, blur_angles;
	double peak_factor[SERIES_COUNT][SLICE], blur_factor[SERIES_COUNT][SLICE];
	double peak[SERIES_COUNT][FORWARD_ANGLE_COUNT];
	double blur[2][SERIES_COUNT][HALF_COUNT]; /* of even and odd l */
};

double forward_depth_coordinate(double s)
{
	return s / (s + 4);
}

double forward_depth_at(double coordinate)
{
	return 4 * coordinate / (1 - coordinate);
}

static double depth_of(int series)
{
	return forward_depth_at((series / BAND_COUNT + 0.5) / FORWARD_DEPTH_COUNT);
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

static void legendre_start(struct legendre *legendre, double (*angle)(int))
{
	for (int i = 0; i < HALF_COUNT; i++) {
		legendre->mu[i] = cos(angle(i));
		legendre->before[i] = 0;
		legendre->value[SLICE][i] = 1;
	}
}

/* Values for l = first .. first + SLICE - 1; the last row holds the one after. */
static void legendre_slice(struct legendre *legendre, int first)
{
	memcpy(legendre->value[0], legendre->value[SLICE], sizeof legendre->value[0]);
	for (int k = 0; k < SLICE; k++) {
		const double *before = k > 0 ? legendre->value[k - 1] : legendre->before;
		double l = first + k, a = (2 * l + 1) / (l + 1), b = l / (l + 1);
		for (int i = 0; i < HALF_COUNT; i++)
			legendre->value[k + 1][i] = a * legendre->mu[i] * legendre->value[k][i] - b * before[i];
	}
	memcpy(legendre->before, legendre->value[SLICE - 1], sizeof legendre->before);
}

/* Moments that matter: past the last, less than 5e-4 of the mean square of P_F is left in any band. Whole slices. */
static int series_length(const struct optics *optics)
{
	int length = SLICE;
	for (int band = 0; band < BAND_COUNT; band++) {
		double total = 0, tail = 0;
		for (int l = 0; l < optics->moment_count; l++)
			total += (2 * l + 1) * optics->moment_forward[band][l] * optics->moment_forward[band][l];
		int l = optics->moment_count;
		for (; l > length; l--) {
			tail += (2 * l - 1) * optics->moment_forward[band][l - 1] * optics->moment_forward[band][l - 1];
			if (tail > 5e-4 * total)
				break;
		}
		length = l;
	}
	length = (length + SLICE - 1) / SLICE * SLICE;
	return length < optics->moment_count ? length : optics->moment_count / SLICE * SLICE;
}

/* Ends the series softly over its last quarter, so that the cut leaves no ripple. */
static double taper(int l, int length)
{
	double t = 4 * (l + 0.5) / length - 3;
	return t <= 0 ? 1 : (1 + cos(M_PI * t)) / 2;
}

/* Coefficients of all series for a slice of l:
 *   peak (2l+1)/(4 pi) exp(-s) (exp(y) - 1 - y),    blur (2l+1) chiS exp(-P_f s) (exp(y) - 1),    y = P_f s chiF. */
static void fill_factors(const struct optics *optics, struct workspace *work, int first, int length)
{
	for (int series = 0; series < SERIES_COUNT; series++) {
		int band = series % BAND_COUNT;
		double s = depth_of(series), peak_depth = optics->forward_peak_fraction[band] * s;
		double none = exp(-s), none_forward = exp(-peak_depth);
		for (int k = 0; k < SLICE; k++) {
			int l = first + k;
			double y = peak_depth * optics->moment_forward[band][l];
			double many = exp(y), scale = (2 * l + 1) * taper(l, length);
			work->peak_factor[series][k] = scale / (4 * M_PI) * none * (many - 1 - y);
			work->blur_factor[series][k] = scale * optics->moment_modified[band][l] * none_forward * (many - 1);
		}
	}
}

/* sum[angle] += factor[k] value[k][angle] over k = first, first + step, ... */
static void add_strips(double *sum, const double *factor, const double (*value)[HALF_COUNT], int first, int step)
{
	for (int strip = 0; strip < HALF_COUNT; strip += STRIP) {
		double local[STRIP];
		memcpy(local, &sum[strip], sizeof local);
		for (int k = first; k < SLICE; k += step)
			for (int i = 0; i < STRIP; i++)
				local[i] += factor[k] * value[k][strip + i];
		memcpy(&sum[strip], local, sizeof local);
	}
}

static void store_tables(const struct workspace *work, struct forward_tables *tables)
{
	for (int series = 0; series < SERIES_COUNT; series++) {
		int depth = series / BAND_COUNT, band = series % BAND_COUNT;
		/* Both are sums of convolutions of positive functions: what falls below 0 is rounding. */
		for (int i = 0; i < FORWARD_ANGLE_COUNT; i++)
			tables->peak[depth][i][band] = (float)fmax(work->peak[series][i], 0);
		for (int i = 0; i < HALF_COUNT; i++) {
			double even = work->blur[0][series][i], odd = work->blur[1][series][i];
			tables->blur[depth][i][band] = (float)fmax(even + odd, 0);
			tables->blur[depth][BLUR_ANGLE_COUNT - 1 - i][band] = (float)fmax(even - odd, 0);
		}
	}
}

void forward_tables_compute(const struct optics *optics, struct forward_tables *tables)
{
	struct workspace work;
	memset(work.peak, 0, sizeof work.peak);
	memset(work.blur, 0, sizeof work.blur);
	legendre_start(&work.peak_angles, peak_angle);
	legendre_start(&work.blur_angles, blur_angle);
	int length = series_length(optics);
	for (int first = 0; first < length; first += SLICE) {
		legendre_slice(&work.peak_angles, first);
		legendre_slice(&work.blur_angles, first);
		fill_factors(optics, &work, first, length);
		for (int series = 0; series < SERIES_COUNT; series++) {
			add_strips(work.peak[series], work.peak_factor[series], work.peak_angles.value, 0, 1);
			add_strips(work.blur[0][series], work.blur_factor[series], work.blur_angles.value, 0, 2);
			add_strips(work.blur[1][series], work.blur_factor[series], work.blur_angles.value, 1, 2);
		}
	}
	store_tables(&work, tables);
}
