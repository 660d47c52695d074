#include "renderer/optics/paper_fit.h"

#include "renderer/log.h"
#include "renderer/optics/paper_fit_solve.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>

enum { BAND = 1, THREAD_MAX = 16, ORDER_TASKS = PAPER_FIT_ROWS * PAPER_FIT_ORDERS };

/* Two per octave, from where T at the zenith falls below 0.995 to where the solver's and the model's both go as 1/H. */
static double total_depth(int i)
{
	return exp2(0.5 * i - 4);
}

/* From where a tenth of light at 70 degrees is scattered to where orders 1 and 2 no longer come through. */
static double order_depth(int i)
{
	return 0.03 * pow(8 / 0.03, (double)i / (PAPER_FIT_ORDERS - 1));
}

struct job {
	const struct optics *optics;
	struct paper_fit_totals totals;
	struct paper_fit_orders orders[PAPER_FIT_ROWS];
	atomic_int next;
};

static double peak_left(const struct optics *optics)
{
	return 1 - optics->forward_peak_fraction[BAND];
}

static void *sample_orders(void *argument)
{
	struct job *job = argument;
	for (int task; (task = atomic_fetch_add(&job->next, 1)) < ORDER_TASKS;) {
		struct paper_fit_orders *orders = &job->orders[task / PAPER_FIT_ORDERS];
		int i = task % PAPER_FIT_ORDERS;
		orders->tau[i] = order_depth(i);
		orders->orders[i] =
			slab_orders_at(job->optics, BAND, SLAB_PHASE_MODIFIED, orders->tau[i] / peak_left(job->optics), orders->mu);
	}
	return NULL;
}

static void sample(struct job *job, const struct slab_solution *solution, int threads)
{
	pthread_t thread[THREAD_MAX];
	int started = 0, wanted = threads < THREAD_MAX ? threads : THREAD_MAX;
	while (started < wanted - 1 && pthread_create(&thread[started], NULL, sample_orders, job) == 0)
		started++;
	struct paper_fit_totals *totals = &job->totals;
	for (int i = 0; i < PAPER_FIT_TOTALS; i++) {
		totals->tau[i] = total_depth(i);
		for (int row = 0; row < PAPER_FIT_ROWS; row++)
			totals->transmitted[row][i] = slab_flux_at(solution, BAND, totals->tau[i], totals->mu[row]).transmitted;
	}
	sample_orders(job);
	for (int i = 0; i < started; i++)
		pthread_join(thread[i], NULL);
}

static double total_rms(const struct paper_fit_totals *samples, int row, const struct paper_fit *fit)
{
	double square = 0;
	for (int i = 0; i < PAPER_FIT_TOTALS; i++) {
		double error = paper_transmittance(fit, samples->tau[i]) - samples->transmitted[row][i];
		square += error * error;
	}
	return sqrt(square / PAPER_FIT_TOTALS);
}

static double order_rms(const struct paper_fit_orders *samples, const struct paper_fit *fit)
{
	double square = 0;
	for (int i = 0; i < PAPER_FIT_ORDERS; i++) {
		const struct paper_first_orders orders = paper_first_orders_at(fit, samples->tau[i]);
		for (int order = 1; order <= 2; order++) {
			double t = orders.t[order] - samples->orders[i].t[order], r = orders.r[order] - samples->orders[i].r[order];
			square += t * t + r * r;
		}
	}
	return sqrt(square / (4 * PAPER_FIT_ORDERS));
}

/* From optical units to metres: T of a metre is 1/(1 + a) with a in proportion to kappa. */
static struct paper_fit in_metres(const struct paper_fit *fit, double extinction, double extinction_modified)
{
	return (struct paper_fit){.beta = 1 / (1 + (1 / fit->beta - 1) * extinction),
				  .b = fit->b,
				  .c = fit->c * extinction,
				  .kappa_c = fit->kappa_c * extinction_modified,
				  .t = fit->t,
				  .r = fit->r};
}

static bool fit_samples(const struct job *job, struct paper_fit_table *table)
{
	struct paper_fit fit[PAPER_FIT_ROWS];
	if (!paper_fit_solve_totals(&job->totals, PAPER_FIT_PRIOR, fit))
		return false;
	for (int row = 0; row < PAPER_FIT_ROWS; row++) {
		if (!paper_fit_solve_orders(&job->orders[row], &fit[row]))
			return false;
		table->total_rms[row] = total_rms(&job->totals, row, &fit[row]);
		table->order_rms[row] = order_rms(&job->orders[row], &fit[row]);
		table->row[row] = in_metres(&fit[row], table->extinction_per_m, table->extinction_modified_per_m);
		if (!isfinite(table->row[row].c + table->row[row].kappa_c + table->total_rms[row] + table->order_rms[row]))
			return false;
	}
	return true;
}

bool paper_fit_table_compute(const struct optics *optics, const struct slab_solution *solution, int threads, struct paper_fit_table *table)
{
	struct paper_fit_table result = {.extinction_per_m = optics->extinction_per_m[BAND],
					 .extinction_modified_per_m = peak_left(optics) * optics->extinction_per_m[BAND]};
	struct job job = {.optics = optics};
	for (int row = 0; row < PAPER_FIT_ROWS; row++) {
		result.zenith_deg[row] = row < PAPER_FIT_ROWS - 1 ? 10 * row : 88;
		job.totals.mu[row] = job.orders[row].mu = cos(result.zenith_deg[row] * M_PI / 180);
	}
	sample(&job, solution, threads);
	if (!fit_samples(&job, &result)) {
		log_error("paper's slab: the fit does not converge");
		return false;
	}
	*table = result;
	return true;
}
