/* Computes the kernel table.
 *
 * A task is one interval between two nodes of one band: the sphere is solved at a few dozen size parameters in between, and their
 * scattering functions are added to both nodes by the hat functions. Every task has a place of its own for its two halves, joined at the
 * end, so that the result does not depend on the number of threads.
 *
 * Within a task the loops are blocked like a matrix product: a slice of n, then a block of angles, then the size parameters. The angular
 * functions of slice and block stay in the first-level cache, the coefficients of the slice in the second.
 */
#include "renderer/optics/kernel_table.h"

#include "renderer/log.h"
#include "renderer/optics/kernel_sums.h"
#include "renderer/optics/mie.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
	INTERVAL_COUNT = KERNEL_NODE_COUNT - 1,
	TASK_COUNT = INTERVAL_COUNT * BAND_COUNT,
	BLOCK_COUNT = KERNEL_PAIR_COUNT / SUMS_LANES,
	SLICE = 128,       /* terms; even, so that each slice begins with an odd n */
	SAMPLE_MAX = 84,   /* of an interval: KERNEL_LOG_STEP * 4000, and a margin for rounding */
	TERM_MAX = 3712,   /* mie_term_count(KERNEL_X_MAX) = 3565, rounded up to a whole slice */
	SCRATCH_MAX = 5120 /* mie_scratch_count(KERNEL_X_MAX, 1.337) = 4830 */
};

_Static_assert(KERNEL_PAIR_COUNT % SUMS_LANES == 0, "blocks of angles must be full");

/* What an interval gives to its left (0) and right (1) node. */
struct task_result {
	double extinction[2], asymmetry[2];
	float intensity[2][KERNEL_ANGLE_COUNT];
};

struct generator {
	const struct kernel_payload *payload;
	struct task_result *results; /* [TASK_COUNT] */
	kernel_progress *progress;
	void *context;
	double work_total;
	_Atomic int next_task;
	_Atomic long work_done;
};

/* pi_(n-1) and pi_n of a block at the n where the next slice begins. */
struct angle_state {
	double mu[SUMS_LANES], before[SUMS_LANES], now[SUMS_LANES];
};

struct worker {
	struct generator *generator;
	double x[SAMPLE_MAX];
	int term_count[SAMPLE_MAX]; /* rounded up to even */
	struct angle_state state[BLOCK_COUNT];
	struct sums_angles angles[SLICE];
	struct mie_term mie[TERM_MAX];
	double scratch[SCRATCH_MAX];
	double intensity[2][KERNEL_ANGLE_COUNT];
	struct sums sums[SAMPLE_MAX][BLOCK_COUNT];
	struct sums_term terms[SAMPLE_MAX][TERM_MAX];
};

/* Steps of x: at most 0.02, or x/4000 where that is more, and a quarter of an interval. They must be fine enough that the ripple of single
 * spheres, which reaches into P near 180 degrees, averages out: 0.05 leaves 0.6 % there for the smallest droplets, 0.2 some percents. */
static int sample_count(int interval)
{
	double x = kernel_node_x(interval + 1);
	int count = (int)ceil(x * KERNEL_LOG_STEP / fmax(0.02, x / 4000));
	return count > 4 ? count : 4;
}

static long task_work(int interval)
{
	return lround(sample_count(interval) * (kernel_node_x(interval) + 20));
}

/* Solves one sphere: its terms for the angular sums, its efficiencies into the task's result. */
static void solve_sphere(struct worker *worker, int sample, double m, const double weight[2], struct task_result *result)
{
	double x = worker->x[sample];
	int count = mie_term_count(x), padded = count + count % 2;
	struct sums_term *terms = worker->terms[sample];
	mie_terms(x, m, worker->mie, worker->scratch);
	for (int n = 1; n <= count; n++) {
		double factor = (2 * n + 1) / (n * (n + 1.0));
		double complex plus = factor * (worker->mie[n - 1].a + worker->mie[n - 1].b);
		double complex minus = factor * (worker->mie[n - 1].a - worker->mie[n - 1].b);
		terms[n - 1] = (struct sums_term){creal(plus), cimag(plus), creal(minus), cimag(minus)};
	}
	if (padded > count)
		terms[count] = (struct sums_term){0};
	worker->term_count[sample] = padded;

	struct mie_efficiency efficiency = mie_efficiency(x, worker->mie, count);
	for (int side = 0; side < 2; side++) {
		result->extinction[side] += weight[side] * efficiency.extinction;
		result->asymmetry[side] += weight[side] * efficiency.scattering * efficiency.asymmetry;
	}
}

static void start_angles(struct worker *worker)
{
	for (int block = 0; block < BLOCK_COUNT; block++)
		for (int lane = 0; lane < SUMS_LANES; lane++) {
			struct angle_state *state = &worker->state[block];
			state->mu[lane] = cos(worker->generator->payload->angle[block * SUMS_LANES + lane]);
			state->before[lane] = 0;
			state->now[lane] = 1;
		}
}

/* pi_n +- tau_n for the slice n = first .. first + SLICE - 1. */
static void advance_angles(struct angle_state *state, struct sums_angles *angles, int first)
{
	for (int i = 0; i < SLICE; i++) {
		double n = first + i, inverse = 1 / n;
		for (int lane = 0; lane < SUMS_LANES; lane++) {
			double now = state->now[lane], before = state->before[lane];
			double tau = n * state->mu[lane] * now - (n + 1) * before;
			angles[i].p[lane] = now + tau;
			angles[i].q[lane] = now - tau;
			state->now[lane] = ((2 * n + 1) * state->mu[lane] * now - (n + 1) * before) * inverse;
			state->before[lane] = now;
		}
	}
}

/* The series of all samples at all angles, into worker->sums. */
static void sum_series(struct worker *worker, int samples)
{
	memset(worker->sums, 0, samples * sizeof worker->sums[0]);
	start_angles(worker);
	for (int start = 0; start < worker->term_count[samples - 1]; start += SLICE)
		for (int block = 0; block < BLOCK_COUNT; block++) {
			advance_angles(&worker->state[block], worker->angles, start + 1);
			for (int sample = 0; sample < samples; sample++) {
				int left = worker->term_count[sample] - start;
				if (left > 0)
					sums_add(&worker->sums[sample][block], &worker->terms[sample][start], worker->angles,
						 left < SLICE ? left : SLICE);
			}
		}
}

/* Adds 2 (|S1|^2 + |S2|^2) / x^2 = (|S1 + S2|^2 + |S1 - S2|^2) / x^2 of one sample, weighted for both nodes. */
static void add_intensity(struct worker *worker, int sample, const double weight[2])
{
	double scale = 1 / (worker->x[sample] * worker->x[sample]);
	for (int pair = 0; pair < KERNEL_PAIR_COUNT; pair++) {
		const struct sums *sums = &worker->sums[sample][pair / SUMS_LANES];
		double square[2] = {0, 0};
		for (int i = 0; i < 8; i++)
			square[i / 4] += sums->value[i][pair % SUMS_LANES] * sums->value[i][pair % SUMS_LANES];
		for (int side = 0; side < 2; side++) {
			worker->intensity[side][pair] += weight[side] * scale * square[0];
			worker->intensity[side][KERNEL_ANGLE_COUNT - 1 - pair] += weight[side] * scale * square[1];
		}
	}
}

static void run_task(struct worker *worker, int interval, int band, struct task_result *result)
{
	int samples = sample_count(interval);
	double weight[SAMPLE_MAX][2];
	for (int i = 0; i < samples; i++) {
		double t = (i + 0.5) / samples;
		weight[i][0] = (1 - t) / samples;
		weight[i][1] = t / samples;
		worker->x[i] = kernel_node_x(interval) * exp(KERNEL_LOG_STEP * t);
		solve_sphere(worker, i, band_refractive_index[band], weight[i], result);
	}
	sum_series(worker, samples);
	memset(worker->intensity, 0, sizeof worker->intensity);
	for (int i = 0; i < samples; i++)
		add_intensity(worker, i, weight[i]);
	for (int side = 0; side < 2; side++)
		for (int angle = 0; angle < KERNEL_ANGLE_COUNT; angle++)
			result->intensity[side][angle] = (float)worker->intensity[side][angle];
}

/* Takes tasks until none is left, the largest first. Only the calling thread of kernel_generate reports. */
static void work(struct worker *worker, bool report)
{
	struct generator *generator = worker->generator;
	for (int task; (task = atomic_fetch_add(&generator->next_task, 1)) < TASK_COUNT;) {
		int interval = INTERVAL_COUNT - 1 - task / BAND_COUNT;
		run_task(worker, interval, task % BAND_COUNT, &generator->results[task]);
		long done = atomic_fetch_add(&generator->work_done, task_work(interval)) + task_work(interval);
		if (report && generator->progress)
			generator->progress(generator->context, done / generator->work_total);
	}
}

static void *worker_main(void *worker)
{
	work(worker, false);
	return NULL;
}

/* A machine that refuses a thread gets a slower run, not a failure. */
static bool run_workers(struct generator *generator, int threads)
{
	pthread_t *thread = calloc(threads, sizeof *thread);
	struct worker *workers = aligned_alloc(64, threads * sizeof *workers);
	bool ok = thread && workers;
	if (ok) {
		int started = 0;
		for (int i = 0; i < threads; i++)
			workers[i].generator = generator;
		while (started < threads - 1 && pthread_create(&thread[started], NULL, worker_main, &workers[started + 1]) == 0)
			started++;
		work(&workers[0], true);
		for (int i = 0; i < started; i++)
			pthread_join(thread[i], NULL);
	}
	free(workers);
	free(thread);
	return ok;
}

/* Joins what the two intervals beside a node gave to it. */
static void join_results(struct kernel_payload *payload, const struct task_result *results)
{
	for (int task = 0; task < TASK_COUNT; task++) {
		int band = task % BAND_COUNT;
		for (int side = 0; side < 2; side++) {
			int node = INTERVAL_COUNT - 1 - task / BAND_COUNT + side;
			payload->extinction[band][node] += results[task].extinction[side];
			payload->asymmetry[band][node] += results[task].asymmetry[side];
			for (int angle = 0; angle < KERNEL_ANGLE_COUNT; angle++)
				payload->intensity[band][node][angle] += results[task].intensity[side][angle];
		}
	}
}

bool kernel_fill(struct kernel_payload *payload, int threads, kernel_progress *progress, void *context)
{
	memset(payload, 0, sizeof *payload);
	kernel_fill_angles(payload);
	struct generator generator = {.payload = payload, .progress = progress, .context = context};
	for (int interval = 0; interval < INTERVAL_COUNT; interval++)
		generator.work_total += BAND_COUNT * (double)task_work(interval);
	generator.results = calloc(TASK_COUNT, sizeof *generator.results);
	bool ok = generator.results && run_workers(&generator, threads);
	if (ok)
		join_results(payload, generator.results);
	else
		log_error("kernel table: out of memory");
	free(generator.results);
	if (ok && progress)
		progress(context, 1);
	return ok;
}

bool kernel_generate(const char *path, int threads, kernel_progress *progress, void *context)
{
	if (threads <= 0)
		threads = (int)sysconf(_SC_NPROCESSORS_ONLN);
	/* More threads than that would only wait for the last tasks, at 14 MB each. */
	threads = threads < 1 ? 1 : threads > 64 ? 64 : threads;
	struct kernel_payload *payload = malloc(sizeof *payload);
	if (!payload) {
		log_error("kernel table: out of memory");
		return false;
	}
	bool ok = kernel_fill(payload, threads, progress, context) && kernel_save(payload, path);
	free(payload);
	return ok;
}
