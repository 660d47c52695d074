#include "renderer/optics/slab_residual.h"

#include "renderer/optics/moments.h"
#include "renderer/optics/slab_layer.h"

#include <math.h>
#include <string.h>

enum {
	DEPTHS = SLAB_RESIDUAL_DEPTH_COUNT,
	ANGLES = SLAB_RESIDUAL_ANGLE_COUNT,
	HALF = ANGLES / 2, /* the others are their mirror images */
	SLICE = 32,
	BACK_COUNT = 1536 /* angles of the back half: three and more per turn of the last P_l */
};

/* sin^2(angle/2) at 100 and 135 degrees. */
#define BACK_FROM 0.587
#define BACK_FULL 0.854

_Static_assert(ANGLES % 16 == 0 && SLICE % 2 == 0, "whole strips, slices that begin with an even l");

double slab_residual_angle(double i)
{
	double sine = sin(M_PI / 2 * i / (ANGLES - 1));
	return M_PI * sine * sine;
}

double slab_residual_angle_index(double angle)
{
	return (ANGLES - 1) * (2 / M_PI) * asin(sqrt(fmin(fmax(angle / M_PI, 0), 1)));
}

double slab_residual_depth(double k)
{
	double w = k / (DEPTHS - 1);
	return w < 1 ? 4 * w / (1 - w) : INFINITY;
}

double slab_residual_depth_index(double s)
{
	return s < 1e9 ? (DEPTHS - 1) * s / (s + 4) : DEPTHS - 1;
}

double slab_mean_attenuation(double a, double b)
{
	double low = fmin(a, b), difference = fabs(a - b);
	if (isinf(low) || isinf(difference))
		return 0;
	return exp(-low) * (difference > 1e-8 ? -expm1(-difference) / difference : 1);
}

double slab_mean_depth(double a, double b)
{
	double low = fmin(a, b), d = fabs(a - b);
	if (d < 1e-3)
		return low + d / 2 - d * d / 12;
	return low + 1 - (d < 700 ? d / expm1(d) : 0);
}

/* 0 below from, 1 above to. */
static double fade(double x, double from, double to)
{
	double t = fmin(fmax((x - from) / (to - from), 0), 1);
	return t * t * (3 - 2 * t);
}

/* Moments that matter: past the last, less than 1e-6 of the square of the phase function's peak is left. Whole slices. */
static int series_length(const double *moment, int count)
{
	double total = 0, tail = 0;
	for (int l = 0; l < count; l++)
		total += (2 * l + 1) * moment[l] * moment[l];
	int l = count;
	for (; l > LAYER_MOMENTS; l--) {
		tail += (2 * l - 1) * moment[l - 1] * moment[l - 1];
		if (tail > 1e-6 * total)
			break;
	}
	l = (l + SLICE - 1) / SLICE * SLICE;
	return l < count ? l : count / SLICE * SLICE;
}

/* Coefficients without their 2l+1, phi = phi_l/(1-f), f = f/(1-f), full = chi_l/(1-f). */
static double transmitted_factor(double s, double phi, double f, double full)
{
	double x = s * f, y = s * phi;
	if (s == 0)
		return 0;
	if (isinf(s))
		return full - phi;
	/* (exp(y) - 1)/s - phi without cancellation where y is small. */
	double rest = y < 1e-4 ? phi * y * (0.5 + y / 6) : expm1(y) / s - phi;
	return exp(-x) * rest - expm1(-x) * (full - phi);
}

/* m(a): mean of exp(-(a - 1) t) over slant depths t = 0..s, weighted with exp(-t). */
static double mean_kept(double s, double a)
{
	return s > 0 ? expm1(-s * a) / (a * expm1(-s)) : 1;
}

/* back: beta_l/(1-f). */
static double reflected_factor(double s, double phi, double f, double back)
{
	return back * (mean_kept(s, 1 + f - phi) - mean_kept(s, 1 + f));
}

static double back_share(double angle)
{
	double sine = sin(angle / 2);
	return fade(sine * sine, BACK_FROM, BACK_FULL);
}

double slab_residual_sharp(const struct slab_band *band, enum slab_side side, double angle, double s)
{
	double f = band->truncated / (1 - band->truncated);
	if (side == SLAB_TRANSMITTED)
		return exp(-s * f);
	return 1 + back_share(angle) * (mean_kept(s, 1 + f) - 1);
}

/* beta_l: moments of the part of P behind. By the trapezoidal rule, whose error at the end is step^2/12 P(pi), the same for all. */
static void back_moments(const struct optics *optics, int band, int length, double *moment)
{
	double mu[BACK_COUNT], value[BACK_COUNT], legendre[2][BACK_COUNT], step = M_PI / 2 / BACK_COUNT;
	for (int i = 0; i < BACK_COUNT; i++) {
		double angle = M_PI - i * step, share = back_share(angle);
		mu[i] = cos(angle);
		value[i] = share > 0 ? share * optics_phase(optics, band, angle) * sin(angle) * step / 2 : 0;
		legendre[0][i] = 1;
		legendre[1][i] = 0;
	}
	for (int l = 0; l < length; l++) {
		double *now = legendre[l % 2], *before = legendre[(l + 1) % 2], sum[4] = {0};
		for (int i = 0; i < BACK_COUNT; i += 4)
			for (int lane = 0; lane < 4; lane++)
				sum[lane] += value[i + lane] * now[i + lane];
		moment[l] = sum[0] + sum[1] + sum[2] + sum[3];
		double a = (2 * l + 1) / (l + 1.0), b = l / (l + 1.0);
		for (int i = 0; i < BACK_COUNT; i++)
			before[i] = a * mu[i] * now[i] - b * before[i];
	}
}

/* P_l for a slice of l, and what continues the recurrence. */
struct legendre {
	double mu[HALF], before[HALF];
	double value[SLICE + 1][HALF];
};

static void legendre_slice(struct legendre *legendre, int first)
{
	memcpy(legendre->value[0], legendre->value[SLICE], sizeof legendre->value[0]);
	for (int k = 0; k < SLICE; k++) {
		const double *before = k > 0 ? legendre->value[k - 1] : legendre->before;
		double l = first + k, a = (2 * l + 1) / (l + 1), b = l / (l + 1);
		for (int i = 0; i < HALF; i++)
			legendre->value[k + 1][i] = a * legendre->mu[i] * legendre->value[k][i] - b * before[i];
	}
	memcpy(legendre->before, legendre->value[SLICE - 1], sizeof legendre->before);
}

/* sum[i] += factor[l] P_l over every other l of the slice. */
static void add_slice(const struct legendre *legendre, const double *factor, int first, double *sum)
{
	for (int strip = 0; strip < HALF; strip += 8) {
		double local[8];
		memcpy(local, &sum[strip], sizeof local);
		for (int k = first; k < SLICE; k += 2)
			for (int i = 0; i < 8; i++)
				local[i] += factor[k] * legendre->value[k][strip + i];
		memcpy(&sum[strip], local, sizeof local);
	}
}

void slab_residual_fill(const struct optics *optics, int band, enum slab_side side, struct slab_band *result)
{
	struct legendre legendre;
	double sum[2][DEPTHS][HALF], f = result->truncated / (1 - result->truncated);
	memset(sum, 0, sizeof sum);
	for (int i = 0; i < HALF; i++) {
		legendre.mu[i] = cos(slab_residual_angle(i));
		legendre.before[i] = 0;
		legendre.value[SLICE][i] = 1;
	}
	const double *moment = optics->moment[band];
	int length = series_length(moment, optics->moment_count);
	double back[MOMENT_COUNT];
	if (side == SLAB_REFLECTED)
		back_moments(optics, band, length, back);
	for (int first = 0; first < length; first += SLICE) {
		legendre_slice(&legendre, first);
		for (int depth = 0; depth < DEPTHS; depth++) {
			double factor[SLICE], s = slab_residual_depth(depth);
			for (int k = 0; k < SLICE; k++) {
				int l = first + k;
				double phi = l < LAYER_MOMENTS ? f : moment[l] / (1 - result->truncated);
				double value = side == SLAB_REFLECTED ? reflected_factor(s, phi, f, back[l] / (1 - result->truncated))
								      : transmitted_factor(s, phi, f, moment[l] / (1 - result->truncated));
				factor[k] = (2 * l + 1) * value;
			}
			add_slice(&legendre, factor, 0, sum[0][depth]);
			add_slice(&legendre, factor, 1, sum[1][depth]);
		}
	}
	for (int depth = 0; depth < DEPTHS; depth++)
		for (int i = 0; i < HALF; i++) {
			double even = sum[0][depth][i], odd = sum[1][depth][i];
			result->residual[side][depth][i] = (float)(even + odd);
			result->residual[side][depth][ANGLES - 1 - i] = (float)(even - odd);
		}
}
