/* What /v1/slab answers, as numbers: the layer of a query computed by one of its methods. Any thread. */
#ifndef STRATUS_SERVER_SLAB_NUMBERS_H
#define STRATUS_SERVER_SLAB_NUMBERS_H

#include "renderer/optics/droplet_tables.h"
#include "renderer/optics/paper_fit.h"
#include "server/slab_query.h"

/* Fluxes are fractions of the incident one; radiance is for F0 = 1 normal to the beam, without the unscattered light. */
struct slab_values {
	double reflectance[BAND_COUNT], transmittance_direct[BAND_COUNT], transmittance_diffuse[BAND_COUNT];
	struct slab_orders orders[BAND_COUNT];
	double *radiance; /* at slab_radiance_index */
};

struct slab_numbers {
	double optical_thickness[BAND_COUNT];
	struct slab_values value;
	struct slab_values error; /* standard errors of all these, of SLAB_BY_PHOTONS alone */
};

/* Place of a radiance: [side][band][view][azimuth]. */
size_t slab_radiance_index(const struct slab_query *query, int side, int band, int view, int azimuth);

/* Degrees between the directions of light before and after, 0 going on forward. */
double slab_scattering_angle_deg(const struct slab_query *query, int side, int view, int azimuth);

/* Of the tables SLAB_BY_PHOTONS takes the optics alone; `fit` is for SLAB_BY_PAPER alone. `cancelled` is asked often, by any thread. false
 * (and *numbers zeroed) when cancelled (silent), when out of memory or when something does not come out finite (a log line). Ended by
 * slab_numbers_finish. */
bool slab_numbers_compute(const struct slab_query *query, const struct droplet_tables *tables, const struct paper_fit_table *fit,
			  bool (*cancelled)(void *context), void *context, struct slab_numbers *numbers);
void slab_numbers_finish(struct slab_numbers *numbers);

#endif
