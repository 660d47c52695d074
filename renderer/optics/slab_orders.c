/* Successive orders of mode 0, by series in the power of z that every scattering multiplies (slab_layer.h). */
#include "renderer/optics/slab.h"

#include "renderer/optics/slab_evaluate.h"
#include "renderer/optics/slab_layer.h"

#include <math.h>
#include <string.h>

enum { N = LAYER_SIZE };

/* Largest starting depth. */
#define THIN_DEPTH 5e-5

/* Light that falls in along any direction: orders 1 and 2 that reach the nodes, and what goes straight on. */
struct beam {
	double mu, truncated;
	double r1[N], r2[N], t1[N], t2[N];
	double straight[3]; /* orders 0, 1, 2: scattered forward only, by what was taken out of the phase function */
};

static void set_straight(struct beam *beam, double depth)
{
	double full = depth / (1 - beam->truncated) / beam->mu, peak = beam->truncated * full;
	beam->straight[0] = exp(-full);
	beam->straight[1] = beam->straight[0] * peak;
	beam->straight[2] = beam->straight[1] * peak / 2;
}

/* A thin layer, lit evenly by what is left of the beam at its middle; the second order by the layer's own nodes at half its depth. */
static void beam_start(struct beam *beam, const struct layer_nodes *nodes, const struct layer_orders *thin, const double *moment,
		       double depth)
{
	double harmonic[LAYER_MOMENTS], node_harmonic[LAYER_MOMENTS], down[N], up[N];
	double middle = depth / 2 / ((1 - beam->truncated) * beam->mu);
	layer_harmonics(0, beam->mu, harmonic);
	set_straight(beam, depth);
	for (int i = 0; i < N; i++) {
		double even = 0, odd = 0, full = depth / (1 - beam->truncated) / nodes->mu[i];
		layer_harmonics(0, nodes->mu[i], node_harmonic);
		for (int l = 0; l < LAYER_MOMENTS; l += 2) {
			even += (2 * l + 1) * moment[l] * harmonic[l] * node_harmonic[l];
			odd += (2 * l + 3) * moment[l + 1] * harmonic[l + 1] * node_harmonic[l + 1];
		}
		double scale = depth / 2 * sqrt(nodes->weight[i] / (nodes->mu[i] * beam->mu)) * exp(-middle - full / 2);
		beam->t1[i] = down[i] = scale * (even + odd);
		beam->r1[i] = up[i] = scale * (even - odd);
	}
	for (int i = 0; i < N; i++) {
		/* Half of the layer lies on the way of what was scattered in the other half. */
		double to_down = 0, to_up = 0, peak = beam->truncated * middle;
		for (int j = 0; j < N; j++) {
			to_down += (thin->t1[i][j] * down[j] + thin->r1[i][j] * up[j]) / 2;
			to_up += (thin->t1[i][j] * up[j] + thin->r1[i][j] * down[j]) / 2;
		}
		beam->t2[i] = to_down + peak * down[i];
		beam->r2[i] = to_up + peak * up[i];
	}
}

/* product += factor (a vector). */
static void add_product(double factor, const layer_matrix a, const double *vector, double *product)
{
	for (int i = 0; i < N; i++)
		for (int j = 0; j < N; j++)
			product[i] += factor * a[i][j] * vector[j];
}

/* Two of the layer on each other; the nodes' orders are those before doubling. */
static void beam_double(struct beam *beam, const struct layer_orders *orders, double depth)
{
	double down1[N], down2[N], up1[N], up2[N];
	const double *straight = beam->straight;
	for (int i = 0; i < N; i++) {
		down1[i] = beam->t1[i];
		down2[i] = beam->t2[i];
		up1[i] = beam->r1[i] * straight[0];
		up2[i] = beam->r2[i] * straight[0] + beam->r1[i] * straight[1];
	}
	add_product(1, orders->r1, up1, down2);
	add_product(1, orders->r1, down1, up2);
	for (int i = 0; i < N; i++) {
		beam->r1[i] += orders->t0[i] * up1[i];
		beam->r2[i] += orders->t0[i] * up2[i];
		beam->t2[i] = beam->t2[i] * straight[0] + beam->t1[i] * straight[1] + orders->t0[i] * down2[i];
		beam->t1[i] = beam->t1[i] * straight[0] + orders->t0[i] * down1[i];
	}
	add_product(1, orders->t1, up1, beam->r2);
	add_product(1, orders->t1, down1, beam->t2);
	set_straight(beam, 2 * depth);
}

/* Plane albedo and scattered transmittance at mu, by the polynomial through the output directions' values. */
static void total_fluxes(const struct slab_layer *layer, const struct layer_nodes *nodes, double mu, double *reflected, double *transmitted)
{
	double r = 0, t = 0;
	for (int j = 0; j < LAYER_OUTPUT; j++) {
		double factor = 1 / (1 - layer->direct[j]);
		for (int k = 0; k < LAYER_OUTPUT; k++)
			if (k != j)
				factor *= (mu - nodes->output_mu[k]) / (nodes->output_mu[j] - nodes->output_mu[k]);
		for (int i = 0; i < N; i++) {
			double out = factor * sqrt(nodes->weight[i] * nodes->mu[i] / nodes->output_mu[j]);
			r += out * layer->r_in[i][j];
			t += out * layer->t_in[i][j];
		}
	}
	*reflected = r * -expm1(-layer->depth / mu);
	*transmitted = t * -expm1(-layer->depth / mu) + exp(-layer->depth / mu);
}

/* The first order is plain: P over all directions round the beam, sorted by their cosine with the vertical, times what a layer lets out.
 * The nodes' series cannot follow the edge of the modified phase function, which leaves up to 6 % of a thin layer's R_1. */
static void first_order(const struct optics *optics, int band, enum slab_phase phase, double depth, double mu_l, double *r1, double *t1)
{
	enum { BINS = 256, TURNS = 32 };
	static const enum slab_side sides[] = {SLAB_REFLECTED, SLAB_TRANSMITTED};
	const bool modified = phase == SLAB_PHASE_MODIFIED;
	const double norm = modified ? 1 - optics->forward_peak_fraction[band] : 1;
	double mass[SLAB_SIDE_COUNT][BINS + 1] = {{0}}, turn[TURNS], sum[SLAB_SIDE_COUNT] = {0}, sine_l = sqrt(1 - mu_l * mu_l);
	for (int k = 0; k < TURNS; k++)
		turn[k] = cos(M_PI * (k + 0.5) / TURNS);
	for (int i = modified ? optics->forward_count : 0; i < optics->angle_count; i++) {
		double cosine = cos(optics->angle[i]), sine = sin(optics->angle[i]);
		double share = optics->weight[i] * optics->phase[band][i] / (2 * TURNS * norm);
		for (int k = 0; k < TURNS; k++) {
			double mu = cosine * mu_l + sine * sine_l * turn[k], at = sqrt(fmin(fabs(mu), 1)) * BINS;
			int bin = at < BINS ? (int)at : BINS - 1;
			double *to = &mass[mu > 0 ? SLAB_TRANSMITTED : SLAB_REFLECTED][bin];
			to[0] += share * (bin + 1 - at);
			to[1] += share * (at - bin);
		}
	}
	for (int side = 0; side < 2; side++)
		for (int i = 0; i <= BINS; i++) {
			double mu = (double)i * i / (BINS * BINS), unused;
			/* Radiance times mu over the incident flux; geometry is per irradiance normal to the beam. */
			sum[sides[side]] += mass[sides[side]][i] * slab_single_geometry(sides[side], depth, mu_l, mu, &unused) * mu / mu_l;
		}
	*r1 = sum[SLAB_REFLECTED];
	*t1 = sum[SLAB_TRANSMITTED];
}

struct slab_orders slab_orders_at(const struct optics *optics, int band, enum slab_phase phase, double tau, double mu_l)
{
	const double *full = phase == SLAB_PHASE_FULL ? optics->moment[band] : optics->moment_modified[band];
	struct beam beam = {.mu = fmin(fmax(mu_l, 1e-3), 1), .truncated = fmin(fmax(full[LAYER_MOMENTS], 0), 0.9)};
	double moment[LAYER_MOMENTS], depth = fmin(fmax(tau, 1e-9), 1e5) * (1 - beam.truncated);
	if (phase == SLAB_PHASE_MODIFIED)
		depth *= 1 - optics->forward_peak_fraction[band];
	for (int l = 0; l < LAYER_MOMENTS; l++)
		moment[l] = (full[l] - beam.truncated) / (1 - beam.truncated);
	int doublings = (int)fmax(ceil(log2(depth / THIN_DEPTH)), 3);
	depth = ldexp(depth, -doublings);

	struct layer_nodes nodes;
	struct layer_scattering scattering;
	struct slab_layer layer;
	struct layer_orders orders;
	layer_nodes_fill(&nodes);
	layer_scattering_fill(&nodes, 0, moment, &scattering);
	layer_start(&layer, &nodes, &scattering, depth);
	layer_orders_start(&orders, &nodes, &scattering, beam.truncated, depth);
	beam_start(&beam, &nodes, &orders, moment, depth);
	for (int i = 0; i < doublings; i++, depth *= 2) {
		beam_double(&beam, &orders, depth);
		layer_orders_double(&orders);
		layer_double(&layer, &nodes);
	}

	struct slab_orders result = {.t = {beam.straight[0], beam.straight[1], beam.straight[2], 0}};
	double reflected, transmitted, r1 = 0, t1 = beam.straight[1];
	for (int i = 0; i < N; i++) {
		double out = sqrt(nodes.weight[i] * nodes.mu[i] / beam.mu);
		r1 += out * beam.r1[i];
		t1 += out * beam.t1[i];
		result.r[2] += out * beam.r2[i];
		result.t[2] += out * beam.t2[i];
	}
	double once = fmin(fmax(tau, 1e-9), 1e5) * (phase == SLAB_PHASE_MODIFIED ? 1 - optics->forward_peak_fraction[band] : 1);
	first_order(optics, band, phase, once, beam.mu, &result.r[1], &result.t[1]);
	/* The total knows nothing of orders: what the nodes' first one was off by, the others are off by the other way round. Photons say
	 * that order 2 and the rest take about half each. */
	result.r[2] = fmax(result.r[2] + (r1 - result.r[1]) / 2, 0);
	result.t[2] = fmax(result.t[2] + (t1 - result.t[1]) / 2, 0);
	total_fluxes(&layer, &nodes, beam.mu, &reflected, &transmitted);
	result.r[3] = fmax(reflected - result.r[1] - result.r[2], 0);
	result.t[3] = fmax(transmitted - result.t[0] - result.t[1] - result.t[2], 0);
	return result;
}
