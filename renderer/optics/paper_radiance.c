#include "renderer/optics/paper_radiance.h"

#include "renderer/optics/quadrature.h"
#include "renderer/optics/slab_evaluate.h"

#include <math.h>

enum { N = PAPER_NODE_COUNT };

/* Incidences nearer to the horizon differ from this one by nothing. */
#define COSINE_MIN 1e-6
#define DEPTH_MAX  1e9

/* --- fluxes of the orders' shapes ---------------------------------------------------------------------------------------------- */

/* By the addition theorem: sum (2l+1) chi_l^order P_l(mu_l) P_l(+-mu_v). 200 terms are plenty for what is integrated next. */
static void average_phase(const struct optics *optics, int band, int order, double mu_l, double mu_v, double average[SLAB_SIDE_COUNT])
{
	enum { TERMS = 200 };
	int terms = optics->moment_count < TERMS ? optics->moment_count : TERMS;
	double a0 = 1, a1 = mu_l, b0 = 1, b1 = mu_v, sum[2] = {0};
	for (int l = 0; l < terms; l++) {
		double chi = optics->moment_modified[band][l];
		sum[l % 2] += (2 * l + 1) * (order == 2 ? chi * chi : chi) * a0 * b0;
		double a2 = ((2 * l + 3) * mu_l * a1 - (l + 1) * a0) / (l + 2);
		double b2 = ((2 * l + 3) * mu_v * b1 - (l + 1) * b0) / (l + 2);
		a0 = a1, a1 = a2, b0 = b1, b1 = b2;
	}
	average[SLAB_TRANSMITTED] = fmax(0, sum[0] + sum[1]);
	average[SLAB_REFLECTED] = fmax(0, sum[0] - sum[1]);
}

void paper_shape_init(struct paper_shape *shape, const struct optics *optics, int band, int order, double mu_l)
{
	shape->mu_l = fmin(fmax(mu_l, COSINE_MIN), 1);
	quadrature_gauss(N, shape->mu, shape->weight);
	for (int i = 0; i < N; i++) {
		double average[SLAB_SIDE_COUNT];
		average_phase(optics, band, order, shape->mu_l, shape->mu[i], average);
		for (int side = 0; side < SLAB_SIDE_COUNT; side++)
			shape->phase[side][i] = average[side];
	}
}

double paper_shape_flux(const struct paper_shape *shape, enum slab_side side, double tau_modified)
{
	double sum = 0;
	for (int i = 0; i < N; i++) {
		double depth, geometry = slab_single_geometry(side, tau_modified, shape->mu_l, shape->mu[i], &depth);
		/* 2 pi mu dmu of the radiance P/(4 pi) geometry, over mu_l. */
		sum += shape->weight[i] * shape->mu[i] * shape->phase[side][i] * geometry;
	}
	return sum / (2 * shape->mu_l);
}

double paper_shape_scale(const struct paper_shape *shape, enum slab_side side, double tau_modified, const struct paper_orders *orders)
{
	double flux = paper_shape_flux(shape, side, tau_modified), wanted = side == SLAB_REFLECTED ? orders->r[2] : orders->t[2];
	return flux > 1e-12 ? fmin(wanted / flux, PAPER_SCALE_MAX) : 0;
}

/* --- a layer ------------------------------------------------------------------------------------------------------------------- */

static double modified_share(const struct optics *optics, int band)
{
	return 1 - optics->forward_peak_fraction[band];
}

struct paper_orders paper_layer_orders(const struct paper_fit_table *table, const struct optics *optics, int band, double tau, double mu_l)
{
	double modified = modified_share(optics, band) * tau;
	struct paper_fit fit = paper_fit_table_at(table, acos(fmin(fmax(mu_l, 0), 1)));
	fit.kappa_c *= modified_share(optics, band) * table->extinction_per_m / table->extinction_modified_per_m;
	return paper_orders_at(&fit, tau / table->extinction_per_m, modified > 0 ? modified / fmax(mu_l, 0) : 0);
}

void paper_layer_init(struct paper_layer *layer, const struct paper_fit_table *table, const struct optics *optics,
		      const struct forward_tables *forward, int band, double tau, double mu_l)
{
	*layer = (struct paper_layer){optics, forward, band, fmin(fmax(tau, 0), DEPTH_MAX), fmin(fmax(mu_l, 0), 1), .orders = {.t = {0}}};
	layer->orders = paper_layer_orders(table, optics, band, layer->tau, layer->mu_l);
	struct paper_shape nodes;
	paper_shape_init(&nodes, optics, band, 2, layer->mu_l);
	for (int side = 0; side < SLAB_SIDE_COUNT; side++)
		layer->double_scale[side] =
			paper_shape_scale(&nodes, (enum slab_side)side, modified_share(optics, band) * layer->tau, &layer->orders);
}

/* --- light of the forward peak ------------------------------------------------------------------------------------------------- */

/* Two neighbours in a table of `count` and the share of the second. */
struct place {
	int first;
	double share;
};

static struct place place_at(double x, int count)
{
	x = fmin(fmax(x, 0), count - 1);
	int first = x < count - 2 ? (int)x : count - 2;
	return (struct place){first, x - first};
}

static struct place depth_place(double s)
{
	double w = isinf(s) ? 1 : forward_depth_coordinate(s);
	return place_at(w * FORWARD_DEPTH_COUNT - 0.5, FORWARD_DEPTH_COUNT);
}

/* Share of a table's first row for depths before it, where events are rare and so as many times rarer: `events` of them. 1 elsewhere. */
static double thin_share(double s, int events)
{
	double first = forward_depth_at(0.5 / FORWARD_DEPTH_COUNT);
	return s < first ? pow(s / first, events) : 1;
}

/* Two forward events or more, 1/sr. */
static double forward_peak(const struct paper_layer *layer, double angle, double s)
{
	if (angle >= FORWARD_ANGLE_MAX)
		return 0;
	const float(*table)[FORWARD_ANGLE_COUNT][BAND_COUNT] = layer->forward->peak;
	struct place row = depth_place(s),
		     column = place_at(sqrt(angle / FORWARD_ANGLE_MAX) * (FORWARD_ANGLE_COUNT - 1), FORWARD_ANGLE_COUNT);
	double side[2];
	for (int i = 0; i < 2; i++) {
		double a = table[row.first + i][column.first][layer->band], b = table[row.first + i][column.first + 1][layer->band];
		side[i] = a + column.share * (b - a);
	}
	return (side[0] + row.share * (side[1] - side[0])) * thin_share(s, 2);
}

/* What forward events add to P_S of the one other event. */
static double forward_blur(const struct paper_layer *layer, double angle, double s)
{
	const float(*table)[BLUR_ANGLE_COUNT][BAND_COUNT] = layer->forward->blur;
	struct place row = depth_place(s), column = place_at(angle / M_PI * (BLUR_ANGLE_COUNT - 1), BLUR_ANGLE_COUNT);
	double side[2];
	for (int i = 0; i < 2; i++) {
		double a = table[row.first + i][column.first][layer->band], b = table[row.first + i][column.first + 1][layer->band];
		side[i] = a + column.share * (b - a);
	}
	return (side[0] + row.share * (side[1] - side[0])) * thin_share(s, 1);
}

/* Orders 0 and 1 of transmitted light. shape: single scattering over P. */
static void add_forward(const struct paper_layer *layer, double mu_v, double angle, double shape, struct paper_radiance *radiance)
{
	double fraction = layer->optics->forward_peak_fraction[layer->band];
	double s = layer->tau > 0 ? layer->tau * 0.5 * (1 / layer->mu_l + 1 / mu_v) : 0;
	/* One event and no forward ones beside it: order 0 inside the forward peak, order 1 outside. */
	double sharp = optics_phase(layer->optics, layer->band, angle) / (1 - fraction) * exp(-fraction * s) * shape;
	radiance->order[angle < FORWARD_PEAK_ANGLE ? 0 : 1] += sharp;
	radiance->order[0] += forward_peak(layer, angle, s);
	radiance->order[1] += forward_blur(layer, angle, s) * shape;
}

struct paper_radiance paper_radiance_at(const struct paper_layer *layer, enum slab_side side, double mu_v, double azimuth)
{
	mu_v = fmin(fmax(mu_v, 0), 1);
	double modified = modified_share(layer->optics, layer->band), depth;
	double angle = acos(slab_scattering_cosine(side, layer->mu_l, mu_v, isfinite(azimuth) ? azimuth : 0));
	double shape = slab_single_geometry(side, modified * layer->tau, layer->mu_l, mu_v, &depth) / (4 * M_PI);
	double multiple = side == SLAB_REFLECTED ? layer->orders.r[3] : layer->orders.t[3];
	struct paper_radiance radiance = {.order = {0, 0, 0, layer->mu_l / M_PI * multiple}};
	radiance.order[2] = optics_phase2(layer->optics, layer->band, angle) * shape * layer->double_scale[side];
	if (side == SLAB_TRANSMITTED)
		add_forward(layer, mu_v, angle, shape, &radiance);
	else
		radiance.order[1] = optics_phase(layer->optics, layer->band, angle) / modified * shape;
	return radiance;
}
