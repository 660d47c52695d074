/* /v1/slab: how much light a layer of droplets sends back and lets through, and where to.
 *
 * The HTTP thread reads and checks the query and answers what needs no computing; then the request is suspended and goes to a worker, or to
 * the one thread that traces photons, and comes back with its answer.
 */
#include "server/routes.h"

#include "renderer/log.h"
#include "server/call.h"
#include "server/clock.h"
#include "server/response.h"
#include "server/service.h"
#include "server/slab_answer.h"

#include <stdatomic.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

struct slab_work {
	struct work work;
	struct request *request;
	struct slab_query query;
	char tag[ENTITY_TAG_SIZE];
	double deadline_ms, queued_ms;
	bool refused; /* too many wait */
	enum call_outcome outcome;
	char *answer;

	/* Whoever computes asks often, which costs a system call: the reason to stop, and when to look for one again. */
	_Atomic int stop; /* enum call_outcome */
	_Atomic double ask_ms;
};

/* How soon a computation ends that nobody waits for. */
#define ASK_EVERY_MS 10.0

static struct slab_work *work_of(struct work *work)
{
	return (struct slab_work *)((char *)work - offsetof(struct slab_work, work));
}

static void work_destroy(void *context)
{
	struct slab_work *work = context;
	free(work->answer);
	free(work);
}

static bool is_tracing(const struct slab_work *work)
{
	return work->query.method == SLAB_BY_PHOTONS;
}

/* --- answering, on the HTTP thread ------------------------------------------------------------------------------------------ */

static enum MHD_Result send_numbers(struct request *request, unsigned status, struct MHD_Response *response)
{
	const struct slab_work *work = request->work;
	return call_send_json(request, status, response, work->tag, CACHE_KEEP);
}

static enum MHD_Result refuse_tracing(struct request *request)
{
	metrics_count_rejection(request->service->metrics, REJECTED_FULL);
	return response_send_new_problem(request, PROBLEM_TRACINGS_FULL,
					 "Photon tracings are waiting: at most %d may, and of one client as many as places are left.",
					 SERVICE_TRACINGS_MAX);
}

static enum MHD_Result finish(struct request *request)
{
	struct slab_work *work = request->work;
	if (work->refused)
		return is_tracing(work) ? refuse_tracing(request) : call_refuse_computing(request);
	if (work->outcome != CALL_OK)
		return call_send_failure(request, work->outcome, "The layer");
	struct MHD_Response *response = response_create(request, work->answer, strlen(work->answer));
	work->answer = NULL;
	return send_numbers(request, MHD_HTTP_OK, response);
}

/* --- when to stop, on any thread ---------------------------------------------------------------------------------------------- */

/* A shutdown finishes what takes a moment, and does not wait for photons. */
static enum call_outcome reason_to_stop(const struct slab_work *work)
{
	const enum call_outcome reason = call_reason_to_stop(work->request, work->deadline_ms);
	return reason != CALL_EXPIRED && is_tracing(work) && work->request->service->stopping ? CALL_STOPPED : reason;
}

static bool waits_in_vain(struct work *base)
{
	return reason_to_stop(work_of(base)) != CALL_OK;
}

/* While photons are traced the tracings that wait are looked after from here: their deadlines do not depend on that one's length. */
static bool is_cancelled(void *context)
{
	struct slab_work *work = context;
	double now = clock_now_ms();
	if (work->stop != CALL_OK || now < work->ask_ms)
		return work->stop != CALL_OK;
	work->ask_ms = now + ASK_EVERY_MS;
	work->stop = (int)reason_to_stop(work);
	if (is_tracing(work))
		worker_pool_sweep(work->request->service->tracers);
	return work->stop != CALL_OK;
}

/* --- computing, on a worker ------------------------------------------------------------------------------------------------------ */

static void compute_with(struct slab_work *work, const struct droplet_tables *tables, const struct paper_fit_table *fit)
{
	struct timings *timings = &work->request->timings;
	struct slab_numbers numbers;
	double start = clock_now_ms();
	if (slab_numbers_compute(&work->query, tables, fit, is_cancelled, work, &numbers)) {
		double written = clock_now_ms();
		timings_set(timings, TIMING_VIEW, written - start);
		work->answer = slab_answer_format(&work->query, &numbers);
		timings_set(timings, TIMING_ENCODE, clock_now_ms() - written);
		slab_numbers_finish(&numbers);
	}
}

/* Photons need the phase function alone, and know nothing of the solved slab that they judge. */
static void trace(struct slab_work *work)
{
	const struct scene *scene = &work->query.input.scene;
	struct service *service = work->request->service;
	double start = clock_now_ms();
	struct optics *optics = optics_create(render_thread_kernel(service->render_thread), &scene->dsd, scene->model.optics);
	timings_set(&work->request->timings, TIMING_OPTICS, clock_now_ms() - start);
	if (optics)
		compute_with(work, &(struct droplet_tables){.optics = optics}, NULL);
	optics_destroy(optics);
	service->tracing_ms = clock_now_ms() - start;
}

static void evaluate(struct slab_work *work)
{
	const struct scene *scene = &work->query.input.scene;
	struct droplet_store *store = render_thread_droplets(work->request->service->render_thread);
	struct timings *timings = &work->request->timings;
	struct paper_fit_table fit;
	enum droplet_source source, fit_source = DROPLETS_FROM_MEMORY;
	const double start = clock_now_ms();
	const struct droplet_tables *tables = droplet_store_get(store, &scene->dsd, scene->model.optics, &source);
	bool good = tables != NULL;
	if (good && work->query.method == SLAB_BY_PAPER)
		good = droplet_store_get_fit(store, &scene->dsd, scene->model.optics, &fit, &fit_source);
	timings_set(timings, TIMING_OPTICS, clock_now_ms() - start);
	timings->entry[TIMING_OPTICS].reused = good && source == DROPLETS_FROM_MEMORY && fit_source == DROPLETS_FROM_MEMORY;
	if (good)
		compute_with(work, tables, &fit);
	if (tables)
		droplet_store_release(store, tables);
	work->request->service->computing_ms = clock_now_ms() - start;
}

static void count(const struct slab_work *work)
{
	static const enum metrics_end ends[] = {[CALL_EXPIRED] = ENDED_EXPIRED,
						[CALL_ABANDONED] = ENDED_ABANDONED,
						[CALL_STOPPED] = ENDED_STOPPED,
						[CALL_FAILED] = ENDED_FAILED};
	struct metrics *metrics = work->request->service->metrics;
	if (!is_tracing(work))
		return;
	if (work->outcome == CALL_OK)
		metrics_count_photons(metrics, BAND_COUNT * work->query.photons);
	else
		metrics_count_tracing_end(metrics, ends[work->outcome]);
}

static void run(struct work *base)
{
	struct slab_work *work = work_of(base);
	timings_set(&work->request->timings, TIMING_QUEUE, clock_now_ms() - work->queued_ms);
	work->outcome = reason_to_stop(work);
	if (work->outcome == CALL_OK) {
		(is_tracing(work) ? trace : evaluate)(work);
		work->outcome = work->stop ? (enum call_outcome)work->stop : reason_to_stop(work);
	}
	if (work->outcome == CALL_OK && !work->answer) {
		log_error("request %s: the layer could not be computed", work->request->id);
		work->outcome = CALL_FAILED;
	}
	count(work);
	request_resume(work->request);
}

/* --- the way through ------------------------------------------------------------------------------------------------------------ */

static enum MHD_Result enqueue(struct request *request)
{
	struct slab_work *work = request->work;
	const struct service *service = request->service;
	work->work.run = run;
	work->work.is_over = waits_in_vain;
	work->work.client = request->client;
	work->queued_ms = clock_now_ms();
	/* Suspended first: a worker may be done before worker_pool_try returns. */
	request_suspend(request, finish);
	if (!worker_pool_try(is_tracing(work) ? service->tracers : service->computers, &work->work)) {
		work->refused = true;
		request_resume(request);
	}
	return MHD_YES;
}

enum MHD_Result route_slab(struct request *request)
{
	struct slab_work *work = calloc(1, sizeof *work);
	if (!work)
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	work->request = request;
	request->work = work;
	request->work_destroy = work_destroy;

	slab_query_read(request->query, &work->query, &request->problem);
	work->deadline_ms = request_read_deadline(request);
	if (request->problem.kind != PROBLEM_NONE || service_refuses(request))
		return response_send_problem(request);
	enum MHD_Result result;
	if (!call_tag(request->service, "slab", slab_query_canonical(&work->query), work->tag))
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	return call_answer_at_once(request, work->tag, send_numbers, &result) ? result : enqueue(request);
}
