/* Photons traced through a homogeneous plane-parallel layer over black ground: the judge of renderer/optics/slab.h, with which it shares
 * nothing but the phase function.
 *
 * Analogue Monte Carlo: free paths by -ln(u), directions by the inverse cumulative distribution of the full P (or of P_S, with kappa_S),
 * fluxes by counting what leaves, radiance by the local estimate P(Theta)/(4 pi) exp(-path/mu_v) at every scattering. Nothing is truncated
 * or approximated, so that the only error is the standard error, which comes along.
 *
 * Conventions are those of slab.h: F0 = 1 normal to the beam, azimuth between the headings of light before and after (0 goes on forward),
 * radiance without the unscattered beam, fluxes as fractions of the incident flux.
 */
#ifndef STRATUS_RENDERER_OPTICS_SLAB_PHOTONS_H
#define STRATUS_RENDERER_OPTICS_SLAB_PHOTONS_H

#include "renderer/optics/slab.h"

#include <stdint.h>

struct photon_params {
	const struct optics *optics;
	int band;
	enum slab_phase phase; /* modified: P_S and (1 - P_f) tau */
	double tau;            /* vertical optical thickness of the full phase function, > 0 */
	double mu_l;           /* 0..1, clamped to at least 1e-3 */
	uint64_t photons;      /* from 1 */
	uint64_t seed;         /* same seed, same result to the last bit, whatever the number of threads */
	int threads;           /* 1..16, the caller's included */

	/* Directions for radiance: every mu_v with every azimuth. Counts may be 0. mu_v 0..1, clamped to at least 1e-3. */
	int view_count, azimuth_count;
	const double *mu_v, *azimuth;

	bool (*cancelled)(void *context); /* asked often, by any thread; may be NULL */
	void *cancel_context;
};

struct photon_result {
	struct slab_orders orders, orders_error; /* fractions by number of scatterings, and their standard errors */
	struct slab_flux flux, flux_error;       /* totals; transmitted holds the unscattered part, direct is that part */

	/* [side][view][azimuth] at (side * view_count + view) * azimuth_count + azimuth, and the standard error. malloc'd; NULL without
	 * directions. */
	double *radiance, *radiance_error;
};

/* false (and *result zeroed) when cancelled (silent) or out of memory (a log line). Ended by photon_result_finish. Any thread. */
bool slab_photons_trace(const struct photon_params *params, struct photon_result *result);
void photon_result_finish(struct photon_result *result);

#endif
