/* The paper's slab (renderer/optics/paper_slab.h) fitted to any droplet size distribution.
 *
 * Bouthors, Neyret, Lefebvre 2006 fitted beta, b, c, kappa_c, t, r of appendix A to photon counts for one distribution (appendix B). Here
 * the same parameters are fitted, by Levenberg-Marquardt (cminpack), to what the slab solver gives for this distribution: T_ms to its total
 * transmittance, orders 1 and 2 to T_1, T_2, R_1, R_2 of the modified phase function. One fit at 550 nm serves the three bands by
 * similarity: their extinctions differ by 2 %. docs/validation/paper-fit.md shows it beside appendix B.
 *
 * Another band, or another distribution of the same shape, of extinction kappa and modified extinction kappa_S:
 *   H' = H kappa/extinction_per_m,   kappa_c' = kappa_c (kappa_S/extinction_modified_per_m) (extinction_per_m/kappa),
 * so that T_ms is similar in kappa H, orders 1 and 2 in kappa_S H.
 */
#ifndef STRATUS_RENDERER_OPTICS_PAPER_FIT_H
#define STRATUS_RENDERER_OPTICS_PAPER_FIT_H

#include "renderer/optics/paper_slab.h"
#include "renderer/optics/slab.h"

enum { PAPER_FIT_ROWS = 10 }; /* theta_l = 0, 10 .. 80 degrees, and one for grazing light */

/* Plain data. Lengths are those of this distribution: c and kappa_c in 1/m, T_ms(H) with H in m. All parameters are > 0. */
struct paper_fit_table {
	double extinction_per_m;          /* kappa at 550 nm: what H of another band is scaled by */
	double extinction_modified_per_m; /* kappa_S at 550 nm: what kappa_c is scaled by */

	/* Incidences of the rows, ascending. The last is 90 in appendix B, 88 in a fit: grazing light has no limit that the form could
	 * take, c and kappa_c grow without end. Beyond the last row it holds as it is. */
	double zenith_deg[PAPER_FIT_ROWS];
	struct paper_fit row[PAPER_FIT_ROWS];

	double total_rms[PAPER_FIT_ROWS]; /* of T_ms against the solver's, over kappa H = 1/16 .. 512; 0 in appendix B */
	double order_rms[PAPER_FIT_ROWS]; /* of T1, T2, R1, R2 likewise, over kappa_S H = 0.03 .. 8 */
};

/* Appendix B itself, for the distribution of the paper. It states no extinction: these are the ones that its T_ms and its kappa_c fit. */
struct paper_fit_table paper_fit_table_published(void);

/* Fits, on `threads` threads (1..16, the caller's included); 20 ms of processor time. optics and its solution: by any model. false (and a
 * log line, *table untouched) when the fit does not converge to finite parameters. Any thread. */
bool paper_fit_table_compute(const struct optics *optics, const struct slab_solution *solution, int threads, struct paper_fit_table *table);

/* Parameters at an incidence, 0..pi/2 (clamped), interpolated between rows without overshoot; c and kappa_c, which go about as 1/mu, by
 * their logarithms. Any thread. */
struct paper_fit paper_fit_table_at(const struct paper_fit_table *table, double zenith_rad);

/* Spherical transmittance 2 integral T_ms(mu) mu dmu under uniform diffuse light; 3 us. Any thread. */
double paper_fit_table_spherical(const struct paper_fit_table *table, double thickness_m);

#endif
