/* Radiances of the paper's slab (Bouthors, Neyret, Lefebvre 2006, section 4) over black ground: what `"shading": "paper"` draws, for one
 * layer and one incidence.
 *
 * Order 0: light of the forward peak alone, transmitted: P within 5 degrees for one such event and the tables of
 * renderer/optics/forward.h for more, at the mean slant depth tau (1/mu_l + 1/mu_v) / 2. Never the unscattered beam.
 * Order 1: single scattering in closed form with P_S and kappa_S, transmitted light blurred by the forward events beside it.
 * Order 2: the shape of single scattering with P_2, scaled so that its flux is T_2 or R_2 of the one-dimensional model.
 * 3 and more: Lambertian, of the flux T_3+ or R_3+.
 * The printed factors kappa and kappa^2 of orders 1 and 2 and R_3+ mu_l/(4 pi mu_v) are wrong by their dimensions and by half the energy.
 *
 * Conventions are those of renderer/optics/slab.h: tau of the full phase function, F0 = 1 normal to the beam, azimuth between the headings
 * of the light. Everything is finite everywhere, also at the horizon, and never negative.
 */
#ifndef STRATUS_RENDERER_OPTICS_PAPER_RADIANCE_H
#define STRATUS_RENDERER_OPTICS_PAPER_RADIANCE_H

#include "renderer/optics/forward.h"
#include "renderer/optics/paper_fit.h"

/* --- fluxes of the orders' shapes ---------------------------------------------------------------------------------------------- */

enum { PAPER_NODE_COUNT = 32 };

/* The shape of single scattering with P_S (order 1) or P_2 (order 2), averaged over azimuth, towards the nodes of a quadrature over either
 * hemisphere. */
struct paper_shape {
	double mu_l; /* at least 1e-6 */
	double mu[PAPER_NODE_COUNT], weight[PAPER_NODE_COUNT];
	double phase[SLAB_SIDE_COUNT][PAPER_NODE_COUNT];
};

/* For one band and incidence, order 1 or 2, mu_l 0..1; 10 us. Any thread. */
void paper_shape_init(struct paper_shape *shape, const struct optics *optics, int band, int order, double mu_l);

/* Its flux, a fraction of the incident flux, for a modified optical thickness (1 - P_f) tau >= 0: of order 1 R_1 and T_1 themselves. */
double paper_shape_flux(const struct paper_shape *shape, enum slab_side side, double tau_modified);

/* Factor that gives the shape of order 2 the flux of order 2, 0..PAPER_SCALE_MAX: a ratio of two numbers that vanish with the thickness, so
 * that much more than 1 would only mean that the fit fails there. */
#define PAPER_SCALE_MAX 4.0
double paper_shape_scale(const struct paper_shape *shape, enum slab_side side, double tau_modified, const struct paper_orders *orders);

/* --- a layer ------------------------------------------------------------------------------------------------------------------- */

/* The one-dimensional model of a layer of any band: T_ms is similar in tau, orders 1 and 2 in (1 - P_f) tau. tau >= 0, mu_l 0..1. */
struct paper_orders paper_layer_orders(const struct paper_fit_table *table, const struct optics *optics, int band, double tau, double mu_l);

struct paper_layer {
	const struct optics *optics;
	const struct forward_tables *forward;
	int band;
	double tau, mu_l;
	struct paper_orders orders;
	double double_scale[SLAB_SIDE_COUNT];
};

/* The tables belong to the caller and must outlive the layer. tau >= 0, clamped to 1e9. Any thread. */
void paper_layer_init(struct paper_layer *layer, const struct paper_fit_table *table, const struct optics *optics,
		      const struct forward_tables *forward, int band, double tau, double mu_l);

struct paper_radiance {
	double order[4]; /* 0, 1, 2, 3 and more */
};

/* mu_v 0..1, azimuth in radians. Any thread. */
struct paper_radiance paper_radiance_at(const struct paper_layer *layer, enum slab_side side, double mu_v, double azimuth);

#endif
