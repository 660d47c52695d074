#include "server/slab_numbers.h"

#include "renderer/log.h"
#include "renderer/optics/paper_radiance.h"
#include "renderer/optics/slab_photons.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define RADIAN (M_PI / 180)

/* A computation on its way. */
struct computation {
	const struct slab_query *query;
	const struct droplet_tables *tables;
	const struct paper_fit_table *fit;
	bool (*cancelled)(void *context);
	void *context;
	struct slab_numbers *numbers;
};

/* --- directions ---------------------------------------------------------------------------------------------------------------- */

/* 0 at the horizon, and nothing beside it. */
static double cosine_of(double degrees)
{
	return degrees >= 90 ? 0 : cos(degrees * RADIAN);
}

/* Between the headings of the light, from azimuth(V) - azimuth(L). */
static double heading_of(double relative_azimuth_deg)
{
	return (180 - relative_azimuth_deg) * RADIAN;
}

size_t slab_radiance_index(const struct slab_query *query, int side, int band, int view, int azimuth)
{
	size_t row = ((size_t)side * BAND_COUNT + (size_t)band) * (size_t)query->view_count + (size_t)view;
	return row * (size_t)query->azimuth_count + (size_t)azimuth;
}

double slab_scattering_angle_deg(const struct slab_query *query, int side, int view, int azimuth)
{
	double mu_l = cosine_of(query->sun_zenith_deg), mu_v = cosine_of(query->view_zenith_deg[view]);
	double heading = heading_of(query->relative_azimuth_deg[azimuth]);
	return acos(slab_scattering_cosine((enum slab_side)side, mu_l, mu_v, heading)) / RADIAN;
}

/* --- by the solver ------------------------------------------------------------------------------------------------------------- */

static bool solve_view(const struct computation *job, int band, enum slab_side side, int view)
{
	const struct slab_query *query = job->query;
	const struct slab_solution *slab = job->tables->slab;
	double tau = job->numbers->optical_thickness[band], mu_l = cosine_of(query->sun_zenith_deg);
	double mu_v = cosine_of(query->view_zenith_deg[view]);
	struct slab_series series;
	if (job->cancelled(job->context))
		return false;
	slab_multiple_series(slab, band, side, tau, mu_l, mu_v, &series);
	for (int i = 0; i < query->azimuth_count; i++) {
		double azimuth = heading_of(query->relative_azimuth_deg[i]);
		job->numbers->value.radiance[slab_radiance_index(query, (int)side, band, view, i)] =
			slab_radiance_single(slab, job->tables->optics, band, side, tau, mu_l, mu_v, azimuth) +
			slab_series_radiance(&series, azimuth);
	}
	return true;
}

static bool solve_band(const struct computation *job, int band)
{
	struct slab_values *value = &job->numbers->value;
	double tau = job->numbers->optical_thickness[band], mu_l = cosine_of(job->query->sun_zenith_deg);
	struct slab_flux flux = slab_flux_at(job->tables->slab, band, tau, mu_l);
	value->reflectance[band] = flux.reflected;
	value->transmittance_direct[band] = flux.direct;
	value->transmittance_diffuse[band] = fmax(flux.transmitted - flux.direct, 0);
	value->orders[band] = slab_orders_at(job->tables->optics, band, (enum slab_phase)job->query->phase, tau, mu_l);
	for (int side = 0; side < SLAB_SIDE_COUNT; side++)
		for (int view = 0; view < job->query->view_count; view++)
			if (!solve_view(job, band, (enum slab_side)side, view))
				return false;
	return true;
}

/* --- in the paper's form ------------------------------------------------------------------------------------------------------- */

static bool paper_band(const struct computation *job, int band)
{
	const struct slab_query *query = job->query;
	struct slab_values *value = &job->numbers->value;
	double tau = job->numbers->optical_thickness[band], mu_l = cosine_of(query->sun_zenith_deg);
	struct paper_layer layer;
	paper_layer_init(&layer, job->fit, job->tables->optics, job->tables->forward, band, tau, mu_l);
	value->reflectance[band] = layer.orders.r_total;
	value->transmittance_direct[band] = mu_l > 0 ? exp(-tau / mu_l) : 0;
	value->transmittance_diffuse[band] = fmax(layer.orders.t_total - value->transmittance_direct[band], 0);
	memcpy(value->orders[band].r, layer.orders.r, sizeof layer.orders.r);
	memcpy(value->orders[band].t, layer.orders.t, sizeof layer.orders.t);
	for (int side = 0; side < SLAB_SIDE_COUNT; side++)
		for (int view = 0; view < query->view_count; view++) {
			if (job->cancelled(job->context))
				return false;
			for (int i = 0; i < query->azimuth_count; i++) {
				struct paper_radiance radiance =
					paper_radiance_at(&layer, (enum slab_side)side, cosine_of(query->view_zenith_deg[view]),
							  heading_of(query->relative_azimuth_deg[i]));
				value->radiance[slab_radiance_index(query, side, band, view, i)] =
					radiance.order[0] + radiance.order[1] + radiance.order[2] + radiance.order[3];
			}
		}
	return true;
}

/* --- by photons ---------------------------------------------------------------------------------------------------------------- */

static int processors(void)
{
	long count = sysconf(_SC_NPROCESSORS_ONLN);
	return count < 1 ? 1 : count > 16 ? 16 : (int)count;
}

static struct photon_params photons_of(const struct computation *job, int band)
{
	return (struct photon_params){
		.optics = job->tables->optics,
		.band = band,
		.phase = SLAB_PHASE_FULL,
		.tau = job->numbers->optical_thickness[band],
		.mu_l = cosine_of(job->query->sun_zenith_deg),
		.photons = (uint64_t)job->query->photons,
		.seed = (uint64_t)job->query->seed,
		.threads = processors(),
		.cancelled = job->cancelled,
		.cancel_context = job->context,
	};
}

/* The result has its radiance by side of one band; ours is by side of all bands. */
static void keep_photons(const struct computation *job, int band, const struct photon_result *result)
{
	const struct slab_query *query = job->query;
	struct slab_values *value = &job->numbers->value, *error = &job->numbers->error;
	size_t row = (size_t)query->view_count * (size_t)query->azimuth_count;
	value->reflectance[band] = result->flux.reflected;
	error->reflectance[band] = result->flux_error.reflected;
	value->transmittance_direct[band] = result->flux.direct;
	error->transmittance_direct[band] = result->flux_error.direct;
	value->transmittance_diffuse[band] = fmax(result->flux.transmitted - result->flux.direct, 0);
	/* The unscattered part is exact: all the error of the transmitted light is in the rest. */
	error->transmittance_diffuse[band] = result->flux_error.transmitted;
	value->orders[band] = result->orders;
	error->orders[band] = result->orders_error;
	for (int side = 0; side < SLAB_SIDE_COUNT; side++) {
		size_t to = slab_radiance_index(query, side, band, 0, 0);
		memcpy(value->radiance + to, result->radiance + (size_t)side * row, row * sizeof(double));
		memcpy(error->radiance + to, result->radiance_error + (size_t)side * row, row * sizeof(double));
	}
}

/* Orders of the modified phase function are another layer's: its photons are traced by themselves. */
static bool trace_modified(const struct computation *job, int band)
{
	struct photon_params params = photons_of(job, band);
	struct photon_result result;
	params.phase = SLAB_PHASE_MODIFIED;
	bool good = slab_photons_trace(&params, &result);
	if (good) {
		job->numbers->value.orders[band] = result.orders;
		job->numbers->error.orders[band] = result.orders_error;
	}
	photon_result_finish(&result);
	return good;
}

static bool trace_band(const struct computation *job, int band)
{
	const struct slab_query *query = job->query;
	double mu_v[SLAB_VIEWS_MAX], azimuth[SLAB_AZIMUTHS_MAX];
	struct photon_params params = photons_of(job, band);
	struct photon_result result;
	for (int i = 0; i < query->view_count; i++)
		mu_v[i] = cosine_of(query->view_zenith_deg[i]);
	for (int i = 0; i < query->azimuth_count; i++)
		azimuth[i] = heading_of(query->relative_azimuth_deg[i]);
	params.view_count = query->view_count;
	params.azimuth_count = query->azimuth_count;
	params.mu_v = mu_v;
	params.azimuth = azimuth;
	bool good = slab_photons_trace(&params, &result);
	if (good)
		keep_photons(job, band, &result);
	photon_result_finish(&result);
	return good && (query->phase == SLAB_PHASE_FULL || trace_modified(job, band));
}

/* --- all of it ----------------------------------------------------------------------------------------------------------------- */

static bool values_allocate(const struct slab_query *query, struct slab_values *values)
{
	values->radiance = calloc(slab_radiance_index(query, SLAB_SIDE_COUNT, 0, 0, 0), sizeof *values->radiance);
	if (!values->radiance)
		log_error("slab: out of memory");
	return values->radiance != NULL;
}

static bool values_finite(const struct slab_query *query, const struct slab_values *values)
{
	double sum = 0;
	for (int band = 0; band < BAND_COUNT; band++) {
		sum += values->reflectance[band] + values->transmittance_direct[band] + values->transmittance_diffuse[band];
		for (int i = 0; i < 4; i++)
			sum += values->orders[band].r[i] + values->orders[band].t[i];
	}
	for (size_t i = 0; i < slab_radiance_index(query, SLAB_SIDE_COUNT, 0, 0, 0); i++)
		sum += values->radiance[i];
	if (!isfinite(sum))
		log_error("slab: a number did not come out finite");
	return isfinite(sum);
}

static void set_optical_thickness(const struct computation *job)
{
	const struct slab_query *query = job->query;
	for (int band = 0; band < BAND_COUNT; band++)
		job->numbers->optical_thickness[band] = query->optical_thickness > 0
								? query->optical_thickness
								: query->thickness_m * job->tables->optics->extinction_per_m[band];
}

bool slab_numbers_compute(const struct slab_query *query, const struct droplet_tables *tables, const struct paper_fit_table *fit,
			  bool (*cancelled)(void *context), void *context, struct slab_numbers *numbers)
{
	static bool (*const methods[])(const struct computation *job, int band) = {
		[SLAB_BY_SOLVER] = solve_band, [SLAB_BY_PAPER] = paper_band, [SLAB_BY_PHOTONS] = trace_band};
	const struct computation job = {query, tables, fit, cancelled, context, numbers};
	*numbers = (struct slab_numbers){.optical_thickness = {0}};
	bool photons = query->method == SLAB_BY_PHOTONS;
	bool good = values_allocate(query, &numbers->value) && (!photons || values_allocate(query, &numbers->error));
	set_optical_thickness(&job);
	for (int band = 0; good && band < BAND_COUNT; band++)
		good = methods[query->method](&job, band);
	if (good)
		good = values_finite(query, &numbers->value) && (!photons || values_finite(query, &numbers->error));
	if (!good)
		slab_numbers_finish(numbers);
	return good;
}

void slab_numbers_finish(struct slab_numbers *numbers)
{
	free(numbers->value.radiance);
	free(numbers->error.radiance);
	*numbers = (struct slab_numbers){.optical_thickness = {0}};
}
