/* Solves for the light between cloud base and ground (paper, section 5) on the processor.
 *
 * With K the exchange of two planes (renderer/stages/exchange.h) and a_G, a_C their albedos, the base receives
 *   E = K a_G (direct + K (source + a_C E)),
 * all bounces of its series at once. K a_G K a_C is self-adjoint under sum a_C u v, so conjugate gradients find E in a few passes, each of
 * one bounce down and one up, where the series itself would take dozens: over snow under a thick deck it falls by a fifth a pass.
 */
#ifndef STRATUS_RENDERER_STAGES_RADIOSITY_SOLVE_H
#define STRATUS_RENDERER_STAGES_RADIOSITY_SOLVE_H

#include "renderer/renderer.h"
#include "renderer/stages/exchange.h"

/* Bands, one plane of side x side texels after the other. Light in W/m2/nm. */
struct radiosity_planes {
	const float *source;        /* clouds' frame: diffuse light that the base sends down by itself */
	const float *cloud_albedo;  /* clouds' frame: of the base for diffuse light, 0..1 */
	const float *ground_albedo; /* 0..1 */
	const float *direct;        /* irradiance of the ground by the beam */
};

/* All in the ground's frame. */
struct radiosity_solution {
	float *ground_received, *cloud_received; /* irradiance, bands as above; the beam is not in it. The caller's memory */
	double ground_diffuse[EXCHANGE_BANDS];   /* mean of the first */
	double ground_direct[EXCHANGE_BANDS];    /* mean of `direct` */
	int passes;
	double residual[RADIOSITY_PASSES_LISTED]; /* after each of the first passes; beyond their number 0 */
	double last_residual;                     /* 0 without passes */
};

/* Stops when the residual is within tolerance or after max_passes. The first pass takes the ground's light up to the base; without any,
 * only what the base sends by itself reaches the ground. Residual: light still on its way from base to ground, root mean square over the
 * tile, over the mean of all that the ground receives; the largest of the bands. false when out of memory. */
bool radiosity_solve(struct exchange *exchange, const struct radiosity_planes *planes, double tolerance, int max_passes,
		     struct radiosity_solution *solution);

#endif
