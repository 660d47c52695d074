#include "renderer/optics/slab_evaluate.h"

#include "renderer/optics/slab_residual.h"

#include <math.h>
#include <string.h>

enum { N = SLAB_NODE_COUNT };

struct stencil stencil_at(double x, int count)
{
	struct stencil stencil;
	int first = (int)x - 1;
	stencil.first = first < 0 ? 0 : first > count - STENCIL ? count - STENCIL : first;
	double t = x - stencil.first;
	stencil.factor[0] = -(t - 1) * (t - 2) * (t - 3) / 6;
	stencil.factor[1] = t * (t - 2) * (t - 3) / 2;
	stencil.factor[2] = -t * (t - 1) * (t - 3) / 2;
	stencil.factor[3] = t * (t - 1) * (t - 2) / 6;
	return stencil;
}

void slab_node_factors(const struct slab_solution *solution, double mu, double factor[SLAB_NODE_COUNT])
{
	for (int i = 0; i < N; i++) {
		factor[i] = 1;
		for (int j = 0; j < N; j++)
			if (j != i)
				factor[i] *= (mu - solution->mu[j]) / (solution->mu[i] - solution->mu[j]);
	}
}

static double clamp_unit(double x)
{
	return fmin(fmax(x, 0), 1); /* 0 for NaN */
}

static double clamp_depth(double tau)
{
	return fmin(fmax(tau, 0), 1e30);
}

static double sine_of(double mu)
{
	return sqrt(1 - mu * mu);
}

/* depth/mu; infinity only where depth is not 0. */
static double slant(double depth, double mu)
{
	return depth > 0 ? depth / mu : 0;
}

/* Share of light that a path of slant depth s does not let pass. */
static double lost(double s)
{
	return -expm1(-s);
}

double slab_thick_share(const struct slab_band *band, double tau)
{
	double deep = slab_depth(SLAB_DEPTH_COUNT - 1);
	return tau > deep ? (deep + band->extrapolation) / (tau + band->extrapolation) : 1;
}

double slab_multiple_scale(const struct slab_band *band, double tau, double mu_l, double mu_v)
{
	double scaled = (1 - band->truncated) * tau;
	return mu_l / M_PI * lost(slant(scaled, mu_l)) * lost(slant(scaled, mu_v));
}

/* --- orders 2 and more --------------------------------------------------------------------------------------------------------- */

/* K_m at a depth with what each pair of nodes contributes. */
static double mode_at(const struct slab_band *band, enum slab_side side, const struct stencil *depth, int mode, const double *pair_factor)
{
	double value = 0;
	for (int k = 0; k < STENCIL; k++) {
		const float *row = band->order2[side][depth->first + k][mode];
		double partial[4] = {0};
		for (int pair = 0; pair < SLAB_PAIR_COUNT; pair += 4)
			for (int lane = 0; lane < 4; lane++)
				partial[lane] += pair_factor[pair + lane] * row[pair + lane];
		value += depth->factor[k] * (partial[0] + partial[1] + partial[2] + partial[3]);
	}
	return value;
}

_Static_assert(SLAB_PAIR_COUNT % 4 == 0, "whole lanes");

static void pair_factors(const struct slab_solution *solution, double mu_l, double mu_v, double factor[SLAB_PAIR_COUNT])
{
	double sun[N], view[N];
	slab_node_factors(solution, mu_l, sun);
	slab_node_factors(solution, mu_v, view);
	for (int i = 0, pair = 0; i < N; i++)
		for (int j = 0; j <= i; j++, pair++)
			factor[pair] = i == j ? sun[i] * view[i] : sun[i] * view[j] + sun[j] * view[i];
}

void slab_multiple_series(const struct slab_solution *solution, int band, enum slab_side side, double tau, double mu_l, double mu_v,
			  struct slab_series *series)
{
	const struct slab_band *table = &solution->band[band];
	mu_l = clamp_unit(mu_l);
	mu_v = clamp_unit(mu_v);
	tau = clamp_depth(tau);
	double factor[SLAB_PAIR_COUNT], sines = sine_of(mu_l) * sine_of(mu_v), scale = slab_multiple_scale(table, tau, mu_l, mu_v);
	pair_factors(solution, mu_l, mu_v, factor);
	struct stencil depth = stencil_at(slab_depth_coordinate(tau), SLAB_DEPTH_COUNT);
	double share = slab_thick_share(table, tau);
	for (int mode = 0; mode < SLAB_MODE_COUNT; mode++) {
		double k = mode_at(table, side, &depth, mode, factor);
		if (share < 1) {
			/* What a thick layer does not transmit it reflects in the same directions. */
			double through = side == SLAB_TRANSMITTED ? k : mode_at(table, SLAB_TRANSMITTED, &depth, mode, factor);
			k += side == SLAB_TRANSMITTED ? (share - 1) * through : (1 - share) * through;
		}
		series->mode[mode] = k * scale * (mode == 0 ? 1 : mode % 2 ? sines : sines * sines);
	}
}

double slab_series_radiance(const struct slab_series *series, double azimuth)
{
	double sum = 0, step = cos(isfinite(azimuth) ? azimuth : 0), now = 1, before = step;
	for (int mode = 0; mode < SLAB_MODE_COUNT; mode++) {
		sum += series->mode[mode] * now;
		double next = 2 * step * now - before;
		before = now;
		now = next;
	}
	return fmax(sum, 0);
}

double slab_radiance_multiple(const struct slab_solution *solution, int band, enum slab_side side, double tau, double mu_l, double mu_v,
			      double azimuth)
{
	struct slab_series series;
	slab_multiple_series(solution, band, side, tau, mu_l, mu_v, &series);
	return slab_series_radiance(&series, azimuth);
}

/* --- the first order ----------------------------------------------------------------------------------------------------------- */

double slab_residual_at(const struct slab_band *band, enum slab_side side, double angle, double s)
{
	struct stencil column = stencil_at(slab_residual_angle_index(angle), SLAB_RESIDUAL_ANGLE_COUNT);
	struct stencil row = stencil_at(slab_residual_depth_index(s), SLAB_RESIDUAL_DEPTH_COUNT);
	double sum = 0;
	for (int i = 0; i < STENCIL; i++)
		for (int j = 0; j < STENCIL; j++)
			sum += row.factor[i] * column.factor[j] * band->residual[side][row.first + i][column.first + j];
	return sum;
}

void slab_residual_column(const struct slab_band *band, enum slab_side side, double angle, float column[SLAB_RESIDUAL_DEPTH_COUNT])
{
	struct stencil stencil = stencil_at(slab_residual_angle_index(angle), SLAB_RESIDUAL_ANGLE_COUNT);
	for (int depth = 0; depth < SLAB_RESIDUAL_DEPTH_COUNT; depth++) {
		double sum = 0;
		for (int k = 0; k < STENCIL; k++)
			sum += stencil.factor[k] * band->residual[side][depth][stencil.first + k];
		column[depth] = (float)sum;
	}
}

double slab_single_geometry(enum slab_side side, double tau, double mu_l, double mu_v, double *depth)
{
	double a = slant(tau, mu_l), b = slant(tau, mu_v);
	if (side == SLAB_REFLECTED) {
		*depth = a + b;
		return mu_l + mu_v > 0 ? mu_l / (mu_l + mu_v) * lost(a + b) : 0;
	}
	/* depth/mu_v times the mean attenuation: at mu_v = 0 the light of the last layer, exp(-a). */
	*depth = isinf(a) || isinf(b) ? fmin(a, b) + 1 : slab_mean_depth(a, b);
	if (isinf(*depth))
		return 0;
	return isinf(b) ? exp(-a) : b * slab_mean_attenuation(a, b);
}

double slab_scattering_cosine(enum slab_side side, double mu_l, double mu_v, double azimuth)
{
	double along = side == SLAB_TRANSMITTED ? mu_l * mu_v : -mu_l * mu_v;
	return fmin(fmax(along + sine_of(mu_l) * sine_of(mu_v) * cos(azimuth), -1), 1);
}

double slab_radiance_single(const struct slab_solution *solution, const struct optics *optics, int band, enum slab_side side, double tau,
			    double mu_l, double mu_v, double azimuth)
{
	const struct slab_band *table = &solution->band[band];
	mu_l = clamp_unit(mu_l);
	mu_v = clamp_unit(mu_v);
	azimuth = isfinite(azimuth) ? azimuth : 0;
	double angle = acos(slab_scattering_cosine(side, mu_l, mu_v, azimuth)), s;
	double geometry = slab_single_geometry(side, (1 - table->truncated) * clamp_depth(tau), mu_l, mu_v, &s);
	if (!(geometry > 0))
		return 0;
	double sharp = slab_residual_sharp(table, side, angle, s);
	double phase = sharp * optics_phase(optics, band, angle) / (1 - table->truncated) + slab_residual_at(table, side, angle, s);
	return fmax(phase, 0) * geometry / (4 * M_PI);
}

double slab_radiance(const struct slab_solution *solution, const struct optics *optics, int band, enum slab_side side, double tau,
		     double mu_l, double mu_v, double azimuth)
{
	return slab_radiance_single(solution, optics, band, side, tau, mu_l, mu_v, azimuth) +
	       slab_radiance_multiple(solution, band, side, tau, mu_l, mu_v, azimuth);
}

/* --- fluxes -------------------------------------------------------------------------------------------------------------------- */

void slab_flux_row(const struct slab_solution *solution, int band, double mu_l, const double *tau, int count, struct slab_flux *flux)
{
	const struct slab_band *table = &solution->band[band];
	double node[N], column[SLAB_SIDE_COUNT][SLAB_DEPTH_COUNT];
	mu_l = clamp_unit(mu_l);
	slab_node_factors(solution, mu_l, node);
	for (int side = 0; side < SLAB_SIDE_COUNT; side++)
		for (int k = 0; k < SLAB_DEPTH_COUNT; k++) {
			column[side][k] = 0;
			for (int i = 0; i < N; i++)
				column[side][k] += node[i] * table->flux[side][k][i];
		}
	for (int i = 0; i < count; i++) {
		double depth = clamp_depth(tau[i]), side_sum[SLAB_SIDE_COUNT] = {0};
		struct stencil stencil = stencil_at(slab_depth_coordinate(depth), SLAB_DEPTH_COUNT);
		for (int side = 0; side < SLAB_SIDE_COUNT; side++)
			for (int k = 0; k < STENCIL; k++)
				side_sum[side] += stencil.factor[k] * column[side][stencil.first + k];
		double share = slab_thick_share(table, depth), s = slant((1 - table->truncated) * depth, mu_l), scattered = lost(s);
		double through = side_sum[SLAB_TRANSMITTED];
		flux[i] = (struct slab_flux){
			.reflected = scattered * (side_sum[SLAB_REFLECTED] + (1 - share) * through),
			.transmitted = exp(-s) + scattered * share * through,
			.direct = exp(-slant(depth, mu_l)),
		};
	}
}

struct slab_flux slab_flux_at(const struct slab_solution *solution, int band, double tau, double mu_l)
{
	struct slab_flux flux;
	slab_flux_row(solution, band, mu_l, &tau, 1, &flux);
	return flux;
}

/* 2 E_3(tau) = 2 integral exp(-tau/mu) mu dmu: below 1e-12 beyond 40. */
static double direct_diffuse(double tau)
{
	if (tau > 40)
		return 0;
	/* By the trapezoidal rule in ln mu, of an integrand that vanishes with all derivatives at one end; Simpson's ends at mu = 1. */
	enum { STEPS = 400 };
	double sum = 0, low = -16;
	for (int i = 0; i <= STEPS; i++) {
		double mu = exp(low * i / STEPS), weight = i == 0 || i == STEPS ? 1 : i % 2 ? 4 : 2;
		sum += weight * 2 * mu * mu * exp(-tau / mu);
	}
	return sum * -low / STEPS / 3;
}

static struct slab_flux spherical_at(const struct slab_solution *solution, int band, double tau)
{
	const struct slab_band *table = &solution->band[band];
	double first = slab_depth(0), sum[SLAB_SIDE_COUNT] = {0};
	struct stencil depth = stencil_at(slab_depth_coordinate(tau), SLAB_DEPTH_COUNT);
	for (int side = 0; side < SLAB_SIDE_COUNT; side++)
		for (int k = 0; k < STENCIL; k++)
			sum[side] += depth.factor[k] * table->spherical[side][depth.first + k];
	double r = sum[SLAB_REFLECTED], t = sum[SLAB_TRANSMITTED], share = slab_thick_share(table, tau);
	if (tau < first) { /* in proportion: nothing reflected by nothing */
		r *= tau / first;
		t = 1 - (1 - t) * tau / first;
	}
	return (struct slab_flux){.reflected = r + (1 - share) * t, .transmitted = share * t};
}

struct slab_flux slab_flux_spherical(const struct slab_solution *solution, int band, double tau)
{
	struct slab_flux flux = spherical_at(solution, band, clamp_depth(tau));
	flux.direct = direct_diffuse(clamp_depth(tau));
	return flux;
}

double slab_spherical_albedo(const struct slab_solution *solution, int band, double tau)
{
	return spherical_at(solution, band, clamp_depth(tau)).reflected;
}
