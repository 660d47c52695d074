/* The one-dimensional slab model of Bouthors, Neyret, Lefebvre 2006, appendix A. Its parameters are in renderer/optics/paper_fit.h. */
#ifndef STRATUS_RENDERER_OPTICS_PAPER_SLAB_H
#define STRATUS_RENDERER_OPTICS_PAPER_SLAB_H

/* Parameters at one incidence. */
struct paper_fit {
	double beta, b, c, kappa_c, t, r; /* beta: T_ms of one metre; c and kappa_c in 1/m */
};

/* Fractions of the incident flux. Index 3 stands for three and more scatterings; r[0] is 0. */
struct paper_orders {
	double t[4], r[4];
	double t_total, r_total; /* T_ms, but at least t[0], and 1 - t_total */
};

/* T_1, T_2, R_1, R_2 by the integrals of appendix A alone, >= 0; index 0 is 0. thickness_m >= 0 (infinity is fine). Any thread. */
struct paper_first_orders {
	double t[3], r[3];
};
struct paper_first_orders paper_first_orders_at(const struct paper_fit *fit, double thickness_m);

/* Orders of scattering. thickness_m: H >= 0, of the distribution that was fitted (of others by similarity, renderer/optics/paper_fit.h);
 * slant_depth_modified: kappa_S H / mu_l >= 0 (infinity is fine), so that T_0 = exp(-slant_depth_modified). Any thread.
 * Never negative, and all orders of both sides add up to 1. The fits alone do not see to that in thin layers (in appendix B R1 + R2 is up
 * to 40 % above R_ms at 80 degrees): where orders 1 and 2 exceed what the total leaves them they are scaled down to it and 3+ is 0. */
struct paper_orders paper_orders_at(const struct paper_fit *fit, double thickness_m, double slant_depth_modified);

/* Total transmittance T_ms alone, 0..1. */
double paper_transmittance(const struct paper_fit *fit, double thickness_m);

#endif
