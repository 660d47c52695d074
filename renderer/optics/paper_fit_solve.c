#include "renderer/optics/paper_fit_solve.h"

#include <cminpack.h>
#include <math.h>

/* Of the sum of squares and of the parameters, relative. */
#define TOLERANCE 1e-9

/* Parameters are logarithms, so that none can turn negative: a = 1/beta - 1, then b and q = c mu/a per row. */
enum {
	TOTAL_PARAMETERS = 1 + 2 * PAPER_FIT_ROWS,
	TOTAL_RESIDUALS = PAPER_FIT_ROWS * (PAPER_FIT_TOTALS + 1),
	ORDER_PARAMETERS = 3,
	ORDER_RESIDUALS = 4 * PAPER_FIT_ORDERS
};

static const double log_prior_q = 1.0986; /* log 3 */

/* cminpack's codes 1..4 are convergence, 6 and 7 that the tolerance is below what rounding allows: as good as it gets. */
static bool converged(int info, int count, const double *parameters)
{
	bool good = info > 0 && info != 5;
	for (int i = 0; i < count; i++)
		good = good && isfinite(exp(parameters[i])) && exp(parameters[i]) > 0;
	return good;
}

struct totals_problem {
	const struct paper_fit_totals *samples;
	double prior;
};

static struct paper_fit total_row(const double *parameters, const struct paper_fit_totals *samples, int row)
{
	const double a = exp(parameters[0]);
	return (struct paper_fit){
		.beta = 1 / (1 + a), .b = exp(parameters[1 + 2 * row]), .c = exp(parameters[2 + 2 * row]) * a / samples->mu[row]};
}

static int total_residuals(void *context, int count, int parameter_count, const double *parameters, double *residual, int flag)
{
	(void)count, (void)parameter_count, (void)flag;
	const struct totals_problem *problem = context;
	const struct paper_fit_totals *samples = problem->samples;
	for (int row = 0; row < PAPER_FIT_ROWS; row++) {
		const struct paper_fit fit = total_row(parameters, samples, row);
		for (int i = 0; i < PAPER_FIT_TOTALS; i++)
			*residual++ = samples->mu[row] * (paper_transmittance(&fit, samples->tau[i]) - samples->transmitted[row][i]);
		*residual++ = samples->mu[row] * problem->prior * sqrt(PAPER_FIT_TOTALS) * (parameters[2 + 2 * row] - log_prior_q);
	}
	return 0;
}

bool paper_fit_solve_totals(const struct paper_fit_totals *samples, double prior, struct paper_fit row[PAPER_FIT_ROWS])
{
	struct totals_problem problem = {samples, prior};
	double parameters[TOTAL_PARAMETERS] = {log(0.1)}, residual[TOTAL_RESIDUALS];
	double work[TOTAL_RESIDUALS * TOTAL_PARAMETERS + 5 * TOTAL_PARAMETERS + TOTAL_RESIDUALS];
	int pivot[TOTAL_PARAMETERS];
	for (int i = 0; i < PAPER_FIT_ROWS; i++) {
		parameters[1 + 2 * i] = log(0.45 + 0.75 * samples->mu[i]);
		parameters[2 + 2 * i] = log_prior_q;
	}
	int info = lmdif1(total_residuals, &problem, TOTAL_RESIDUALS, TOTAL_PARAMETERS, parameters, residual, TOLERANCE, pivot, work,
			  sizeof work / sizeof *work);
	if (!converged(info, TOTAL_PARAMETERS, parameters))
		return false;
	for (int i = 0; i < PAPER_FIT_ROWS; i++) {
		const struct paper_fit fit = total_row(parameters, samples, i);
		row[i].beta = fit.beta;
		row[i].b = fit.b;
		row[i].c = fit.c;
	}
	return true;
}

static int order_residuals(void *context, int count, int parameter_count, const double *parameters, double *residual, int flag)
{
	(void)count, (void)parameter_count, (void)flag;
	const struct paper_fit_orders *samples = context;
	const struct paper_fit fit = {.kappa_c = exp(parameters[0]), .t = exp(parameters[1]), .r = exp(parameters[2])};
	for (int i = 0; i < PAPER_FIT_ORDERS; i++) {
		const struct paper_first_orders orders = paper_first_orders_at(&fit, samples->tau[i]);
		for (int order = 1; order <= 2; order++) {
			*residual++ = orders.t[order] - samples->orders[i].t[order];
			*residual++ = orders.r[order] - samples->orders[i].r[order];
		}
	}
	return 0;
}

bool paper_fit_solve_orders(const struct paper_fit_orders *samples, struct paper_fit *fit)
{
	/* R_1 of a thick column is r/2, R_2 is r t/2; light leaves it along about 1/mu, less for grazing light, which is scattered first.
	 */
	const double *thick = samples->orders[PAPER_FIT_ORDERS - 1].r;
	double parameters[ORDER_PARAMETERS] = {-log(samples->mu + 0.1), log(fmax(thick[2] / fmax(thick[1], 1e-6), 1e-3)),
					       log(2 * fmax(thick[1], 1e-6))};
	double residual[ORDER_RESIDUALS], work[ORDER_RESIDUALS * ORDER_PARAMETERS + 5 * ORDER_PARAMETERS + ORDER_RESIDUALS];
	int pivot[ORDER_PARAMETERS];
	int info = lmdif1(order_residuals, (void *)samples, ORDER_RESIDUALS, ORDER_PARAMETERS, parameters, residual, TOLERANCE, pivot, work,
			  sizeof work / sizeof *work);
	if (!converged(info, ORDER_PARAMETERS, parameters))
		return false;
	fit->kappa_c = exp(parameters[0]);
	fit->t = exp(parameters[1]);
	fit->r = exp(parameters[2]);
	return true;
}
