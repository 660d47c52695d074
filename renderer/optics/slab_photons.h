/* Photons traced through a homogeneous plane-parallel layer over black ground: the judge of renderer/optics/slab.h, with which it shares
 * nothing but the phase function.
 *
 * Analogue Monte Carlo: free paths by -ln(u), directions by the inverse cumulative distribution of the full P (or of P_S, with kappa_S),
 * fluxes by counting what leaves, radiance by local estimates at every scattering. Nothing is truncated or approximated, so that the only
 * error is the standard error, which comes along. Two things alone are not analogue, and both are exact:
 * - Every photon is scattered at least once; the unscattered share exp(-tau/mu_l) is known. Thin layers need no more photons than others.
 * - Scatterings by the forward peak at a path's end are traced from the viewer (renderer/optics/photon_views.h says how and why). The plain
 *   estimate would need a hundred times as many photons for droplets of 7 um, and thousands for 30 um.
 *
 * Standard errors. Photons are independent, so each error is the spread of all photons' values over sqrt(photons); values of different
 * directions come from the same photons and err together. A million photons give radiance, in the median over directions up to 85 degrees
 * from the vertical, to 0.1 to 0.4 % at tau 0.5 and at tau 8, at tau 50 reflected to 0.2 and transmitted to 0.8 %; at 85 degrees to 2 or 3
 * times that. What few photons contribute to is skewed: where the error is above some 10 %, as may be at the horizon itself, it is a rough
 * one. Within 10 degrees of the beam, behind thick layers of the largest droplets, light comes in rare flashes: 3 % at 30 um and tau 10.
 *
 * Time: a thick layer scatters a photon 6/7 (1 + 2 mu_l) tau times on average (diffusion; half to one and a half of that at tau 8), at 15
 * to 25 million scatterings per second and processor. The longest ways end exponentially, by a factor e per 0.3 (1-g) (tau + 1.4/(1-g))^2
 * scatterings, so that every photon comes to its end. Radiance costs 0.1 us per photon and view and 5 ns per estimate, and nothing deep
 * inside thick layers.
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
	double tau;            /* vertical optical thickness of the full phase function, > 0; clamped to 0..1e9 */
	double mu_l;           /* 0..1, clamped to at least 1e-3 */
	uint64_t photons;      /* from 1 */
	uint64_t seed;         /* same seed, same result to the last bit, whatever the number of threads */
	int threads;           /* 1..16, the caller's included */

	/* Directions for radiance: every mu_v with every azimuth. Counts may be 0. mu_v 0..1, clamped to at least 1e-3. */
	int view_count, azimuth_count;
	const double *mu_v, *azimuth;
	int order_count; /* of radiance_orders, 0..64 */

	bool (*cancelled)(void *context); /* asked every few milliseconds by every thread, several at once; may be NULL */
	void *cancel_context;
};

struct photon_result {
	/* Fractions by number of scatterings, and their standard errors: never 0 for what was counted, even if it was never seen. */
	struct slab_orders orders, orders_error;
	struct slab_flux flux, flux_error; /* totals; transmitted holds the unscattered part, direct is that part */

	/* [side][view][azimuth] at (side * view_count + view) * azimuth_count + azimuth, and the standard error: the value itself when
	 * there was one photon, and 0 where none sent anything. malloc'd; NULL without directions. */
	double *radiance, *radiance_error;
	/* [order][side][view][azimuth], light scattered order + 1 times, the last as often and oftener; they add up to radiance. malloc'd;
	 * NULL without directions or with order_count 0. */
	double *radiance_orders;

	uint64_t scatterings; /* of all photons */
};

/* false (and *result zeroed) when cancelled (silent) or out of memory (a log line). Ended by photon_result_finish. Any thread. */
bool slab_photons_trace(const struct photon_params *params, struct photon_result *result);
void photon_result_finish(struct photon_result *result);

#endif
