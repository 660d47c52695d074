#include "tests/validate/paper_radiance.h"

#include "renderer/optics/quadrature.h"
#include "tests/validate/validate.h"

enum { BAND = 1, NODES = 64, TURNS = 128 };

/* Single scattering over P/(4 pi). */
static double single_shape(enum slab_side side, double tau, double mu_l, double mu_v)
{
	const double a = 1 / fmax(mu_l, mu_v), x = tau * (1 / fmin(mu_l, mu_v) - a);
	if (side == SLAB_REFLECTED)
		return mu_l / (mu_l + mu_v) * -expm1(-tau * (1 / mu_l + 1 / mu_v));
	return tau / mu_v * exp(-tau * a) * (x < 1e-6 ? 1 - x / 2 : -expm1(-x) / x);
}

/* Flux of single scattering's shape with P_2, as a fraction of the sun's. */
static double double_flux(const struct paper_layer *layer, enum slab_side side)
{
	double mu[NODES], weight[NODES], sum = 0;
	quadrature_gauss(NODES, mu, weight);
	for (int i = 0; i < NODES; i++)
		for (int k = 0; k < TURNS; k++) {
			const double angle = acos(scattering_cosine(side, layer->mu_l, mu[i], (k + 0.5) * M_PI / TURNS));
			sum += weight[i] * mu[i] / TURNS * optics_phase2(layer->optics, BAND, angle) *
			       single_shape(side, layer->tau_modified, layer->mu_l, mu[i]);
		}
	return sum / (2 * layer->mu_l);
}

struct paper_layer paper_layer_init(const struct optics *optics, const struct forward_tables *forward, const struct paper_fit_table *fit,
				    double thickness_m, double mu_l)
{
	const double kappa = optics->extinction_per_m[BAND];
	struct paper_layer layer = {.optics = optics, .forward = forward, .tau = kappa * thickness_m, .mu_l = mu_l};
	layer.tau_modified = (1 - optics->forward_peak_fraction[BAND]) * layer.tau;
	const struct paper_fit row = paper_fit_table_at(fit, acos(mu_l));
	layer.orders = paper_orders_at(&row, thickness_m, layer.tau_modified / mu_l);
	layer.scale[SLAB_REFLECTED] = layer.orders.r[2] / double_flux(&layer, SLAB_REFLECTED);
	layer.scale[SLAB_TRANSMITTED] = layer.orders.t[2] / double_flux(&layer, SLAB_TRANSMITTED);
	return layer;
}

/* Linear between the table's depths and angles. x is the index of an angle. */
static double interpolate(const float *table, int angles, double x, double s)
{
	const double y = fmin(fmax(forward_depth_coordinate(s) * FORWARD_DEPTH_COUNT - 0.5, 0), FORWARD_DEPTH_COUNT - 1);
	const int i = (int)fmin(x, angles - 2), k = (int)fmin(y, FORWARD_DEPTH_COUNT - 2);
	const double u = x - i, v = y - k;
	double value = 0;
	for (int corner = 0; corner < 4; corner++) {
		const int column = i + corner % 2, row = k + corner / 2;
		const double weight = (corner % 2 ? u : 1 - u) * (corner / 2 ? v : 1 - v);
		value += weight * (double)table[(row * angles + column) * BAND_COUNT + BAND];
	}
	return value;
}

struct paper_light paper_layer_light(const struct paper_layer *layer, enum slab_side side, double mu_v, double azimuth)
{
	const bool through = side == SLAB_TRANSMITTED;
	const double angle = acos(scattering_cosine(side, layer->mu_l, mu_v, azimuth)), p_f = layer->optics->forward_peak_fraction[BAND];
	const double shape = single_shape(side, layer->tau_modified, layer->mu_l, mu_v) / (4 * M_PI);
	const double depth = through ? layer->tau * 0.5 * (1 / layer->mu_l + 1 / mu_v) : 0;
	const double sharp = optics_phase(layer->optics, BAND, angle) * exp(-p_f * depth) / (1 - p_f) * shape;
	const double blur =
		through ? interpolate(&layer->forward->blur[0][0][0], BLUR_ANGLE_COUNT, angle / M_PI * (BLUR_ANGLE_COUNT - 1), depth) : 0;
	struct paper_light light = {0};
	if (angle < FORWARD_PEAK_ANGLE)
		light.order[0] = sharp;
	else
		light.order[1] = sharp;
	if (through && angle < FORWARD_ANGLE_MAX)
		light.order[0] += interpolate(&layer->forward->peak[0][0][0], FORWARD_ANGLE_COUNT,
					      sqrt(angle / FORWARD_ANGLE_MAX) * (FORWARD_ANGLE_COUNT - 1), depth);
	light.order[1] += blur * shape;
	light.order[2] = optics_phase2(layer->optics, BAND, angle) * shape * layer->scale[side];
	light.order[3] = (through ? layer->orders.t[3] : layer->orders.r[3]) * layer->mu_l / M_PI;
	return light;
}
