#include "renderer/optics/optics_storage.h"

#include "renderer/log.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/* Largest differences between the angular quadrature and the series that rounding and the angles explain. */
#define NORM_TOLERANCE      1e-3
#define ASYMMETRY_TOLERANCE 1e-3

/* P_2 is positive everywhere; what is left of its truncated series must not bring it to 0, since its logarithm is interpolated. */
#define PHASE2_MIN 1e-6

void optics_storage_link(struct optics_storage *storage)
{
	struct optics *optics = &storage->optics;
	optics->angle_count = KERNEL_ANGLE_COUNT;
	optics->angle = storage->angle;
	optics->weight = storage->weight;
	optics->forward_count = 1 + KERNEL_PEAK_COUNT;
	optics->moment_count = MOMENT_COUNT;
	for (int band = 0; band < BAND_COUNT; band++) {
		optics->phase[band] = storage->phase[band];
		optics->phase2[band] = storage->phase2[band];
		optics->moment[band] = storage->moment[band];
		optics->moment_forward[band] = storage->moment_forward[band];
		optics->moment_modified[band] = storage->moment_modified[band];
	}
}

/* pi r^3 n(r) at each node of the kernel, in 1/m: the distribution's cross-section per unit of ln r, Q apart. */
static void cross_sections(const struct scene_dsd *dsd, double wavelength_m, double section_per_m[KERNEL_NODE_COUNT])
{
	double rn = 1e-6 * dsd->effective_radius_um / (dsd->gamma + 2);
	double scale = 1e6 * dsd->n0_per_cm3 * M_PI / tgamma(dsd->gamma);
	for (int node = 0; node < KERNEL_NODE_COUNT; node++) {
		double r = kernel_node_x(node) * wavelength_m / (2 * M_PI);
		section_per_m[node] = scale * r * r * exp(dsd->gamma * log(r / rn) - r / rn);
	}
}

/* P of a band, before its exact normalisation: the mean of the nodes' intensities, weighted by cross-section. */
static void mix_intensity(const float (*intensity)[KERNEL_ANGLE_COUNT], const double share[KERNEL_NODE_COUNT], double *phase)
{
	float sum[KERNEL_ANGLE_COUNT] = {0};
	for (int node = 0; node < KERNEL_NODE_COUNT; node++) {
		if (share[node] < 1e-14) /* of intensities up to 1e7 against a P of at least 1e-3 */
			continue;
		float factor = (float)share[node];
		for (int i = 0; i < KERNEL_ANGLE_COUNT; i++)
			sum[i] += factor * intensity[node][i];
	}
	for (int i = 0; i < KERNEL_ANGLE_COUNT; i++)
		phase[i] = sum[i];
}

/* Mean of P over the sphere, of its first `count` angles. */
static double sphere_mean(const struct optics *optics, int band, int count)
{
	double sum = 0;
	for (int i = 0; i < count; i++)
		sum += optics->weight[i] * optics->phase[band][i];
	return sum / 2;
}

/* Extinction, g by the series and P of a band. false when P and series disagree. */
static bool weigh_band(const struct kernel_payload *table, const struct scene_dsd *dsd, int band, struct optics *optics)
{
	double section[KERNEL_NODE_COUNT], extinction = 0, asymmetry = 0;
	cross_sections(dsd, 1e-9 * band_wavelength_nm[band], section);
	for (int node = 0; node < KERNEL_NODE_COUNT; node++) {
		section[node] *= KERNEL_LOG_STEP;
		extinction += section[node] * table->extinction[band][node];
		asymmetry += section[node] * table->asymmetry[band][node];
	}
	for (int node = 0; node < KERNEL_NODE_COUNT; node++)
		section[node] /= extinction;
	mix_intensity(table->intensity[band], section, optics->phase[band]);

	double norm = sphere_mean(optics, band, KERNEL_ANGLE_COUNT);
	for (int i = 0; i < KERNEL_ANGLE_COUNT; i++)
		optics->phase[band][i] /= norm;
	optics->extinction_per_m[band] = extinction;
	optics->single_scattering_albedo[band] = 1;
	optics->asymmetry[band] = asymmetry / extinction;
	optics->forward_peak_fraction[band] = sphere_mean(optics, band, optics->forward_count);
	if (fabs(norm - 1) < NORM_TOLERANCE)
		return true;
	log_error("optics: the phase function at %g nm has norm %g", band_wavelength_nm[band], norm);
	return false;
}

/* Moments of P from those of its two halves, P_2 from the squares of P_S's. false when g and chi_1 disagree. */
static bool fill_moments(struct optics *optics)
{
	moments_project((const double *const *)optics->phase, optics->moment_forward, optics->moment_modified);
	double square[BAND_COUNT][MOMENT_COUNT];
	bool ok = true;
	for (int band = 0; band < BAND_COUNT; band++) {
		double peak = optics->forward_peak_fraction[band];
		for (int l = 0; l < MOMENT_COUNT; l++) {
			double modified = optics->moment_modified[band][l];
			optics->moment[band][l] = peak * optics->moment_forward[band][l] + (1 - peak) * modified;
			square[band][l] = modified * modified;
		}
		if (fabs(optics->moment[band][1] - optics->asymmetry[band]) > ASYMMETRY_TOLERANCE) {
			log_error("optics: at %g nm g is %g by the series but %g by the phase function", band_wavelength_nm[band],
				  optics->asymmetry[band], optics->moment[band][1]);
			ok = false;
		}
		optics->asymmetry[band] = optics->moment[band][1];
	}
	moments_expand(optics->angle, square, optics->phase2);
	for (int band = 0; band < BAND_COUNT; band++)
		for (int i = 0; i < KERNEL_ANGLE_COUNT; i++)
			optics->phase2[band][i] = fmax(optics->phase2[band][i], PHASE2_MIN);
	return ok;
}

bool optics_storage_fill(struct optics_storage *storage, const struct kernel *kernel, const struct scene_dsd *dsd, enum optics_model model)
{
	struct optics *optics = &storage->optics;
	optics_storage_link(storage);
	memcpy(storage->angle, kernel->payload.angle, sizeof storage->angle);
	memcpy(storage->weight, kernel->payload.weight, sizeof storage->weight);
	for (int band = 0; band < BAND_COUNT; band++)
		if (!weigh_band(&kernel->payload, dsd, band, optics))
			return false;
	if (!fill_moments(optics))
		return false;
	if (model == OPTICS_PAPER) {
		/* Section 3 of the paper: kappa = N0 pi re^2 for all wavelengths. */
		double re_m = 1e-6 * dsd->effective_radius_um;
		for (int band = 0; band < BAND_COUNT; band++)
			optics->extinction_per_m[band] = 1e6 * dsd->n0_per_cm3 * M_PI * re_m * re_m;
	}
	return true;
}

_Static_assert(offsetof(struct optics_storage, optics) == 0, "optics_destroy frees all");

struct optics *optics_create(const struct kernel *kernel, const struct scene_dsd *dsd, enum optics_model model)
{
	struct optics_storage *storage = calloc(1, sizeof *storage);
	if (!storage) {
		log_error("optics: out of memory");
		return NULL;
	}
	if (optics_storage_fill(storage, kernel, dsd, model))
		return &storage->optics;
	free(storage);
	return NULL;
}

void optics_destroy(struct optics *optics)
{
	free(optics);
}

/* Slope at the middle of three points, of the parabola through them. (A monotone cubic, flat at every extremum, clips the fogbow by 1 %.)
 */
static double parabola_slope(const double x[3], const double y[3])
{
	double left = x[1] - x[0], right = x[2] - x[1];
	return (right / left * (y[1] - y[0]) + left / right * (y[2] - y[1])) / (left + right);
}

/* Cubic through the logarithms, so that no overshoot can reach 0; both ends are extrema by symmetry. */
static double interpolate(const struct optics *optics, const double *values, double angle)
{
	const double *x = optics->angle;
	int low = 0, high = optics->angle_count - 1;
	while (high - low > 1) {
		int middle = (low + high) / 2;
		*(x[middle] <= angle ? &low : &high) = middle;
	}
	bool inner_left = low > 0, inner_right = high < optics->angle_count - 1;
	int first = inner_left ? low - 1 : low, last = inner_right ? high + 1 : high;
	double y[4];
	for (int i = first; i <= last; i++)
		y[i - first] = log(values[i]);
	const double *here = &y[low - first];
	double step = x[high] - x[low], t = fmin(fmax((angle - x[low]) / step, 0), 1);
	double slope_low = inner_left ? parabola_slope(&x[low - 1], y) : 0;
	double slope_high = inner_right ? parabola_slope(&x[low], here) : 0;
	double rise = here[1] - here[0];
	double bend = (1 - t) * (step * slope_low - rise) + t * (rise - step * slope_high);
	return exp(here[0] + t * rise + t * (1 - t) * bend);
}

double optics_phase(const struct optics *optics, int band, double angle)
{
	return interpolate(optics, optics->phase[band], angle);
}

double optics_phase2(const struct optics *optics, int band, double angle)
{
	return interpolate(optics, optics->phase2[band], angle);
}
