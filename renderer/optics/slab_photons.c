#include "renderer/optics/slab_photons.h"

#include "renderer/log.h"
#include "renderer/optics/photon_views.h"

#include <limits.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

enum {
	BATCH_MAX = 64,
	ORDER_COUNT = 4,
	THREAD_MAX = 16,
	PATIENCE = 1 << 15 /* scatterings or estimates between two questions whether to go on: a millisecond or two */
};

/* Photons with random numbers of their own, traced by one thread from the first to the last. */
struct batch {
	uint64_t photons, scatterings;
	uint64_t left[SLAB_SIDE_COUNT][ORDER_COUNT]; /* photons that left, by number of scatterings */
	double *sum, *square;                        /* of the photons' radiances, per direction */
	double *order_sum;                           /* by order too; NULL: not wanted */
};

struct job {
	const struct photon_params *params;
	struct photon_phase *phase;
	double tau, mu_l;  /* as traced: of the phase function that is asked for */
	double scattering; /* fraction of the beam that is scattered at all */
	int batch_count;
	struct batch batch[BATCH_MAX];
	double *values; /* memory of all sums and squares */
	size_t value_count;
	int order_count; /* 0 without directions */
	atomic_int next;
	atomic_bool stopped;
};

/* What a thread works with. */
struct tracer {
	struct job *job;
	struct batch *batch;
	struct photon_views *views; /* NULL without directions */
	struct photon_random random;
	int patience;
};

/* --- photons ------------------------------------------------------------------------------------------------------------------- */

/* Asks now and then whether to go on. */
static bool goes_on(struct tracer *tracer, int work)
{
	tracer->patience -= work;
	if (tracer->patience > 0)
		return true;
	tracer->patience = PATIENCE;
	const struct photon_params *params = tracer->job->params;
	if (params->cancelled && params->cancelled(params->cancel_context))
		atomic_store(&tracer->job->stopped, true);
	return !atomic_load(&tracer->job->stopped);
}

/* Every photon is scattered at least once, at a depth from the exponential distribution within the layer: the unscattered share is known,
 * and thin layers need no more photons than others. false when stopped. */
static bool trace_photon(struct tracer *tracer)
{
	struct job *job = tracer->job;
	struct photon_random *random = &tracer->random;
	double direction[3] = {sqrt(1 - job->mu_l * job->mu_l), 0, job->mu_l};
	double depth = fmin(-log1p(-photon_random_unit(random) * job->scattering) * job->mu_l, job->tau);
	bool straight = true;
	uint64_t order = 0;
	while (depth >= 0 && depth <= job->tau) {
		order++;
		int work = 1;
		if (tracer->views)
			work += photon_views_scatter(tracer->views, depth, direction, straight, order < INT_MAX ? (int)order : INT_MAX);
		struct photon_angle angle = photon_phase_draw(job->phase, random);
		straight = straight && angle.peak;
		photon_turn(direction, angle, random);
		depth += photon_random_path(random) * direction[2];
		if (!goes_on(tracer, work))
			return false;
	}
	tracer->batch->scatterings += order;
	tracer->batch->left[depth < 0 ? SLAB_REFLECTED : SLAB_TRANSMITTED][order < ORDER_COUNT ? order : ORDER_COUNT - 1]++;
	return true;
}

static bool trace_batch(struct tracer *tracer, int number)
{
	struct batch *batch = tracer->batch = &tracer->job->batch[number];
	const struct photon_params *params = tracer->job->params;
	photon_random_start(&tracer->random, params->seed, (uint64_t)number);
	for (uint64_t i = 0; i < batch->photons; i++) {
		if (tracer->views)
			photon_views_aim(tracer->views, &tracer->random);
		if (!trace_photon(tracer))
			return false;
		if (tracer->views)
			photon_views_collect(tracer->views, batch->sum, batch->square, batch->order_sum);
		if (!goes_on(tracer, 8 * params->view_count))
			return false;
	}
	return true;
}

static void *worker_main(void *argument)
{
	struct job *job = argument;
	const struct photon_params *params = job->params;
	struct tracer tracer = {.job = job};
	if (job->value_count > 0) {
		tracer.views = photon_views_create(job->phase, job->tau, params->view_count, params->mu_v, params->azimuth_count,
						   params->azimuth, job->order_count > 0 ? job->order_count : 1);
		if (!tracer.views)
			atomic_store(&job->stopped, true);
	}
	for (int number; !atomic_load(&job->stopped) && (number = atomic_fetch_add(&job->next, 1)) < job->batch_count;)
		trace_batch(&tracer, number);
	photon_views_destroy(tracer.views);
	return NULL;
}

/* --- results ------------------------------------------------------------------------------------------------------------------- */

/* Adds all batches to the first, in their order. */
static void reduce(struct job *job)
{
	struct batch *total = &job->batch[0];
	for (int number = 1; number < job->batch_count; number++) {
		const struct batch *batch = &job->batch[number];
		total->photons += batch->photons;
		total->scatterings += batch->scatterings;
		for (int i = 0; i < SLAB_SIDE_COUNT * ORDER_COUNT; i++)
			total->left[i / ORDER_COUNT][i % ORDER_COUNT] += batch->left[i / ORDER_COUNT][i % ORDER_COUNT];
		for (size_t i = 0; i < job->value_count; i++) {
			total->sum[i] += batch->sum[i];
			total->square[i] += batch->square[i];
		}
		for (size_t i = 0; i < (size_t)job->order_count * job->value_count; i++)
			total->order_sum[i] += batch->order_sum[i];
	}
}

/* Standard deviation of a share of which k of n were counted, all shares being equally likely before: sqrt(p (1-p)/n) for any but small
 * counts, and not 0 for what was never seen. */
static double share_error(uint64_t k, uint64_t n)
{
	double seen = (double)k + 1, unseen = (double)(n - k) + 1;
	return sqrt(seen * unseen / (seen + unseen + 1)) / (seen + unseen);
}

static void fill_fluxes(const struct job *job, struct photon_result *result)
{
	const struct batch *total = &job->batch[0];
	double n = (double)total->photons, scattering = job->scattering;
	uint64_t reflected = 0;
	for (int order = 1; order < ORDER_COUNT; order++) {
		uint64_t r = total->left[SLAB_REFLECTED][order], t = total->left[SLAB_TRANSMITTED][order];
		result->orders.r[order] = scattering * (double)r / n;
		result->orders.t[order] = scattering * (double)t / n;
		result->orders_error.r[order] = scattering * share_error(r, total->photons);
		result->orders_error.t[order] = scattering * share_error(t, total->photons);
		reflected += r;
	}
	double direct = exp(-job->tau / job->mu_l), error = scattering * share_error(reflected, total->photons);
	result->orders.t[0] = direct;
	result->flux.direct = direct;
	result->flux.reflected = scattering * (double)reflected / n;
	result->flux.transmitted = direct + scattering * (double)(total->photons - reflected) / n;
	result->flux_error = (struct slab_flux){.reflected = error, .transmitted = error};
	result->scatterings = total->scatterings;
}

static bool fill_radiances(const struct job *job, struct photon_result *result)
{
	const struct batch *total = &job->batch[0];
	if (job->value_count == 0)
		return true;
	result->radiance = malloc(job->value_count * sizeof *result->radiance);
	result->radiance_error = malloc(job->value_count * sizeof *result->radiance_error);
	if (job->order_count > 0)
		result->radiance_orders = malloc((size_t)job->order_count * job->value_count * sizeof *result->radiance_orders);
	if (!result->radiance || !result->radiance_error || (job->order_count > 0 && !result->radiance_orders)) {
		log_error("photons: out of memory");
		return false;
	}
	double n = (double)total->photons, scale = job->mu_l * job->scattering;
	for (size_t i = 0; i < job->value_count; i++) {
		double mean = total->sum[i] / n, spread = fmax(total->square[i] / n - mean * mean, 0);
		result->radiance[i] = scale * mean;
		result->radiance_error[i] = scale * (n > 1 ? sqrt(spread / (n - 1)) : mean);
	}
	for (size_t i = 0; i < (size_t)job->order_count * job->value_count; i++)
		result->radiance_orders[i] = scale * total->order_sum[i] / n;
	return true;
}

/* --- the job ------------------------------------------------------------------------------------------------------------------- */

static bool job_init(struct job *job, const struct photon_params *params)
{
	bool modified = params->phase == SLAB_PHASE_MODIFIED;
	double share = modified ? 1 - params->optics->forward_peak_fraction[params->band] : 1;
	*job = (struct job){.params = params, .tau = share * fmin(fmax(params->tau, 0), 1e9), .mu_l = fmin(fmax(params->mu_l, 1e-3), 1)};
	job->scattering = -expm1(-job->tau / job->mu_l);
	job->value_count = (size_t)SLAB_SIDE_COUNT * (size_t)params->view_count * (size_t)params->azimuth_count;
	job->order_count = job->value_count > 0 ? params->order_count : 0;
	job->batch_count = params->photons < BATCH_MAX ? (int)params->photons : BATCH_MAX;
	const size_t batch_values = (2 + (size_t)job->order_count) * job->value_count;
	job->phase = malloc(sizeof *job->phase);
	job->values = calloc((size_t)job->batch_count * batch_values + 1, sizeof *job->values);
	if (!job->phase || !job->values) {
		log_error("photons: out of memory");
		return false;
	}
	photon_phase_fill(job->phase, params->optics, params->band, params->phase);
	uint64_t photons = params->photons, count = (uint64_t)job->batch_count;
	for (uint64_t i = 0; i < count; i++) {
		struct batch *batch = &job->batch[i];
		batch->photons = photons / count + (i < photons % count);
		batch->sum = job->values + i * batch_values;
		batch->square = batch->sum + job->value_count;
		batch->order_sum = job->order_count > 0 ? batch->square + job->value_count : NULL;
	}
	return true;
}

static void job_finish(struct job *job)
{
	free(job->phase);
	free(job->values);
}

static void job_run(struct job *job, int threads)
{
	pthread_t thread[THREAD_MAX];
	int started = 0, wanted = threads < THREAD_MAX ? threads : THREAD_MAX;
	while (started < wanted - 1 && pthread_create(&thread[started], NULL, worker_main, job) == 0)
		started++;
	worker_main(job);
	for (int i = 0; i < started; i++)
		pthread_join(thread[i], NULL);
}

bool slab_photons_trace(const struct photon_params *params, struct photon_result *result)
{
	struct job job;
	*result = (struct photon_result){0};
	bool ok = job_init(&job, params);
	if (ok)
		job_run(&job, params->threads);
	ok = ok && !atomic_load(&job.stopped);
	if (ok) {
		reduce(&job);
		fill_fluxes(&job, result);
		ok = fill_radiances(&job, result);
	}
	if (!ok)
		photon_result_finish(result);
	job_finish(&job);
	return ok;
}

void photon_result_finish(struct photon_result *result)
{
	if (!result)
		return;
	free(result->radiance);
	free(result->radiance_error);
	free(result->radiance_orders);
	*result = (struct photon_result){0};
}
