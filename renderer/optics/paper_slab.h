/* The one-dimensional slab model of Bouthors, Neyret, Lefebvre 2006, appendix A, with the fitted parameters of appendix B.
 *
 * Appendix B belongs to one droplet size distribution, whose T_ms fits an extinction of 0.0388 /m; another distribution is taken by
 * similarity: its thickness counts as H kappa / 0.0388.
 */
#ifndef STRATUS_RENDERER_OPTICS_PAPER_SLAB_H
#define STRATUS_RENDERER_OPTICS_PAPER_SLAB_H

/* Extinction (1/m) that appendix B was fitted for. */
#define PAPER_EXTINCTION_PER_M 0.0388

/* Modified extinction (1/m) that kappa_c was fitted for: N0 pi re^2 (1 - P_f) of the same droplets, with P_f = 0.455. Orders 1 and 2 of
 * other droplets follow their own kappa_S, by a kappa_c scaled to it; T_1, R_1 of photons traced through such a slab then come out within
 * 0.02. */
#define PAPER_MODIFIED_EXTINCTION_PER_M 0.0252

struct paper_fit {
	double beta, b, c, kappa_c, t, r; /* c and kappa_c in 1/m of the paper's distribution */
};

/* Fractions of the incident flux. Index 3 stands for three and more scatterings; r[0] is 0. */
struct paper_orders {
	double t[4], r[4];
	double t_total, r_total; /* T_ms, but at least t[0], and 1 - t_total */
};

/* Parameters at an incidence, interpolated between the rows of appendix B. zenith_rad 0..pi/2. Any thread. */
struct paper_fit paper_fit_at(double zenith_rad);

/* Orders of scattering. thickness_m: H >= 0 of the paper's distribution (by similarity: H kappa / PAPER_EXTINCTION_PER_M);
 * slant_depth_modified: kappa_S H / mu_l >= 0 (infinity is fine), so that T_0 = exp(-slant_depth_modified). Any thread.
 * Never negative, and all orders of both sides add up to 1. The fits alone do not see to that in thin layers (R1 + R2 is up to 40 % above
 * R_ms at 80 degrees): where orders 1 and 2 exceed what the total leaves them they are scaled down to it and 3+ is 0. */
struct paper_orders paper_orders_at(const struct paper_fit *fit, double thickness_m, double slant_depth_modified);

/* Total transmittance T_ms alone, 0..1. */
double paper_transmittance(const struct paper_fit *fit, double thickness_m);

/* Spherical transmittance 2 integral T_ms(mu) mu dmu under uniform diffuse light. */
double paper_spherical_transmittance(double thickness_m);

#endif
