/* The paper's slab (renderer/optics/paper_slab.h) fitted to any droplet size distribution.
 *
 * Bouthors, Neyret, Lefebvre 2006 fitted beta, b, c, kappa_c, t, r of appendix A to photon counts for one distribution (appendix B). Here
 * the same parameters are fitted, by Levenberg-Marquardt (cminpack), to the orders of scattering R_i, T_i of the modified phase function
 * that the slab solver gives for this distribution. One fit at 550 nm serves the three bands by similarity (H kappa / kappa_550): their
 * extinctions differ by 2 %.
 */
#ifndef STRATUS_RENDERER_OPTICS_PAPER_FIT_H
#define STRATUS_RENDERER_OPTICS_PAPER_FIT_H

#include "renderer/optics/paper_slab.h"
#include "renderer/optics/slab.h"

enum { PAPER_FIT_ROWS = 10 }; /* theta_l = 0, 10 .. 90 degrees; 90 is the limit of grazing light, fitted just above the horizon */

/* Plain data. Lengths are those of this distribution: c and kappa_c in 1/m, T_ms(H) with H in m. */
struct paper_fit_table {
	double extinction_per_m;          /* kappa at 550 nm: what H of another band is scaled by */
	double extinction_modified_per_m; /* kappa_S at 550 nm */
	struct paper_fit row[PAPER_FIT_ROWS];
	double total_rms[PAPER_FIT_ROWS]; /* of T_ms against the solver's, over the thicknesses of the fit */
	double order_rms[PAPER_FIT_ROWS]; /* of T1, T2, R1, R2 likewise */
};

/* Appendix B itself, for the distribution of the paper. */
struct paper_fit_table paper_fit_table_published(void);

/* Fits; some 50 ms on `threads` threads. false (and a log line) when the fit does not converge to finite parameters. Any thread. */
bool paper_fit_table_compute(const struct optics *optics, const struct slab_solution *solution, int threads, struct paper_fit_table *table);

/* Parameters at an incidence, 0..pi/2, interpolated between rows without overshoot. Any thread. */
struct paper_fit paper_fit_table_at(const struct paper_fit_table *table, double zenith_rad);

/* Spherical transmittance 2 integral T_ms(mu) mu dmu under uniform diffuse light. Any thread. */
double paper_fit_table_spherical(const struct paper_fit_table *table, double thickness_m);

#endif
