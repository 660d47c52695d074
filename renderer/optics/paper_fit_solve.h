/* Parameters of the paper's slab from samples, by Levenberg-Marquardt. Private to renderer/optics.
 *
 * All in optical units: lengths of T_ms are kappa H, those of orders 1 and 2 kappa_S H, so that beta, c and kappa_c are of order 1 for any
 * distribution, and depend on its phase function alone.
 */
#ifndef STRATUS_RENDERER_OPTICS_PAPER_FIT_SOLVE_H
#define STRATUS_RENDERER_OPTICS_PAPER_FIT_SOLVE_H

#include "renderer/optics/paper_fit.h"

enum { PAPER_FIT_TOTALS = 27, PAPER_FIT_ORDERS = 10 };

/* Total transmittance per incidence and thickness kappa H. */
struct paper_fit_totals {
	double mu[PAPER_FIT_ROWS], tau[PAPER_FIT_TOTALS];
	double transmitted[PAPER_FIT_ROWS][PAPER_FIT_TOTALS];
};

/* T_1, T_2, R_1, R_2 of one incidence per thickness kappa_S H; orders 0 and 3 are not looked at. */
struct paper_fit_orders {
	double mu, tau[PAPER_FIT_ORDERS];
	struct slab_orders orders[PAPER_FIT_ORDERS];
};

/* Where b is near 1 (at 45 degrees) c has no effect and could be anything; a value far from its neighbours' would spoil the incidences
 * between. c mu/a, a = 1/beta - 1, is about 3 for all distributions and incidences: a factor e away from it costs as much as this rms of
 * T_ms does. */
#define PAPER_FIT_PRIOR 0.002

/* Sets beta (one for all), b, c. Rows weigh mu, as sunlight on a layer does. prior: PAPER_FIT_PRIOR, or 0 for none. false (silent): no
 * convergence. */
bool paper_fit_solve_totals(const struct paper_fit_totals *samples, double prior, struct paper_fit row[PAPER_FIT_ROWS]);

/* Sets kappa_c, t, r. false (silent): no convergence. */
bool paper_fit_solve_orders(const struct paper_fit_orders *samples, struct paper_fit *fit);

#endif
