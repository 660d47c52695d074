#include "server/preparation.h"

#include "renderer/log.h"
#include "server/clock.h"
#include "server/shares.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

/* How often a job that waits for room is asked whether it is over. */
enum { ROOM_MS = 5 };

struct preparation {
	struct droplet_store *store;
	struct render_queue *waiting, *queue;
	pthread_mutex_t mutex; /* of the places in `waiting`, as its clients have them */
	struct shares *places;
	pthread_t thread;
	_Atomic int holders; /* jobs that hold tables */
	_Atomic double busy_since_ms, typical_ms;
};

static bool needs_fit(const struct scene *scene)
{
	return scene->model.shading == SHADING_PAPER;
}

static void hold(struct preparation *preparation, struct render_job *job, const struct droplet_tables *tables)
{
	job->droplets = tables;
	if (tables)
		preparation->holders++;
}

void preparation_release(struct preparation *preparation, struct render_job *job)
{
	if (!job->droplets)
		return;
	droplet_store_release(preparation->store, job->droplets);
	job->droplets = NULL;
	preparation->holders--;
}

/* Holds what the job needs when that is in memory. */
static bool find(struct preparation *preparation, struct render_job *job)
{
	const struct scene *scene = job->scene;
	if (needs_fit(scene) && !droplet_store_has(preparation->store, &scene->dsd, scene->model.optics, true))
		return false;
	hold(preparation, job, droplet_store_find(preparation->store, &scene->dsd, scene->model.optics));
	return job->droplets != NULL;
}

static bool push_waiting(struct preparation *preparation, struct render_job *job)
{
	pthread_mutex_lock(&preparation->mutex);
	bool taken = shares_allow(preparation->places, job->client);
	if (!taken)
		job->refusal = RENDER_REFUSED_COUNT;
	/* Within the mutex: the thread gives the place back when it has the job. */
	taken = taken && render_queue_push(preparation->waiting, job);
	if (taken)
		shares_take(preparation->places, job->client);
	pthread_mutex_unlock(&preparation->mutex);
	return taken;
}

static void pass_waiting(struct preparation *preparation, struct render_job *job)
{
	pthread_mutex_lock(&preparation->mutex);
	render_queue_pass(preparation->waiting, job);
	shares_take(preparation->places, job->client);
	pthread_mutex_unlock(&preparation->mutex);
}

static void leave_waiting(struct preparation *preparation, const struct render_job *job)
{
	pthread_mutex_lock(&preparation->mutex);
	shares_give(preparation->places, job->client);
	pthread_mutex_unlock(&preparation->mutex);
}

bool preparation_push(struct preparation *preparation, struct render_job *job)
{
	if (!scene_has_clouds(job->scene))
		return render_queue_push(preparation->queue, job);
	if (!find(preparation, job))
		return push_waiting(preparation, job);
	if (render_queue_push(preparation->queue, job))
		return true;
	preparation_release(preparation, job);
	return false;
}

void preparation_pass(struct preparation *preparation, struct render_job *job)
{
	if (!scene_has_clouds(job->scene) || find(preparation, job))
		render_queue_pass(preparation->queue, job);
	else
		pass_waiting(preparation, job);
}

/* --- the thread ------------------------------------------------------------------------------------------------------------------- */

/* Waits while as much is held as may be, by jobs that will give it back. false when the job is over. */
static bool await_room(struct preparation *preparation, struct render_job *job)
{
	double begin = clock_now_ms();
	bool over = render_job_is_over(job);
	while (!over && preparation->holders > 0 && !droplet_store_await_room(preparation->store, ROOM_MS))
		over = render_job_is_over(job);
	job->waited_ms += clock_now_ms() - begin;
	return !over;
}

static bool obtain(struct preparation *preparation, struct render_job *job)
{
	const struct scene *scene = job->scene;
	enum droplet_source source, fit_source = DROPLETS_FROM_MEMORY;
	struct paper_fit_table fit;
	hold(preparation, job, droplet_store_get(preparation->store, &scene->dsd, scene->model.optics, &source));
	bool ok = job->droplets &&
		  (!needs_fit(scene) || droplet_store_get_fit(preparation->store, &scene->dsd, scene->model.optics, &fit, &fit_source));
	job->prepared = source != DROPLETS_FROM_MEMORY || fit_source != DROPLETS_FROM_MEMORY;
	return ok;
}

/* Returns false when the job is to end here. */
static bool prepare(struct preparation *preparation, struct render_job *job)
{
	if (find(preparation, job))
		return true;
	if (!await_room(preparation, job))
		return false;
	double begin = clock_now_ms();
	preparation->busy_since_ms = begin;
	bool ok = obtain(preparation, job);
	job->prepared_ms = clock_now_ms() - begin;
	preparation->busy_since_ms = 0;
	if (job->prepared)
		preparation->typical_ms =
			preparation->typical_ms > 0 ? 0.7 * preparation->typical_ms + 0.3 * job->prepared_ms : job->prepared_ms;
	if (!ok)
		job->outcome = RENDER_OUTCOME_FAILED;
	return ok;
}

static void run(struct preparation *preparation, struct render_job *job)
{
	leave_waiting(preparation, job);
	const bool ready = prepare(preparation, job);
	render_queue_settle(preparation->waiting, job, job->prepared_ms);
	if (ready)
		render_queue_pass(preparation->queue, job);
	else
		job->finished(job);
}

/* Jobs that need not wait for the others: what they need is there, or nobody waits for them. */
static bool is_quick(struct render_job *job, void *context)
{
	struct preparation *preparation = context;
	const struct scene *scene = job->scene;
	return droplet_store_has(preparation->store, &scene->dsd, scene->model.optics, needs_fit(scene)) || render_job_is_over(job);
}

static void *prepare_all(void *argument)
{
	struct preparation *preparation = argument;
	for (struct render_job *job; (job = render_queue_pop(preparation->waiting));) {
		run(preparation, job);
		while ((job = render_queue_pop_wanted(preparation->waiting, is_quick, preparation)))
			run(preparation, job);
	}
	return NULL;
}

/* --- life ------------------------------------------------------------------------------------------------------------------------- */

static void destroy(struct preparation *preparation)
{
	render_queue_destroy(preparation->waiting);
	shares_destroy(preparation->places);
	pthread_mutex_destroy(&preparation->mutex);
	free(preparation);
}

struct preparation *preparation_create(struct droplet_store *store, struct render_queue *queue, const struct render_queue_limits *limits)
{
	struct preparation *preparation = calloc(1, sizeof *preparation);
	if (!preparation) {
		log_error("preparation_create: out of memory");
		return NULL;
	}
	preparation->store = store;
	preparation->queue = queue;
	preparation->waiting = render_queue_create(limits);
	preparation->places = shares_create(limits->jobs);
	pthread_mutex_init(&preparation->mutex, NULL);
	if (preparation->waiting && preparation->places && pthread_create(&preparation->thread, NULL, prepare_all, preparation) == 0)
		return preparation;
	log_error("preparation_create: no queue or no thread");
	destroy(preparation);
	return NULL;
}

void preparation_destroy(struct preparation *preparation)
{
	if (!preparation)
		return;
	render_queue_close(preparation->waiting);
	pthread_join(preparation->thread, NULL);
	destroy(preparation);
}

static bool is_over(struct render_job *job, void *context)
{
	(void)context;
	return render_job_is_over(job);
}

void preparation_drop_over(struct preparation *preparation)
{
	for (struct render_job *job; (job = render_queue_remove(preparation->waiting, is_over, NULL));) {
		leave_waiting(preparation, job);
		job->finished(job);
	}
}

bool preparation_needs(const struct preparation *preparation, const struct scene *scene)
{
	return scene_has_clouds(scene) && !droplet_store_has(preparation->store, &scene->dsd, scene->model.optics, needs_fit(scene));
}

size_t preparation_depth(struct preparation *preparation)
{
	return render_queue_depth(preparation->waiting);
}

double preparation_pixels(struct preparation *preparation)
{
	return render_queue_pixels(preparation->waiting);
}

size_t preparation_depth_before(struct preparation *preparation, const char *client)
{
	pthread_mutex_lock(&preparation->mutex);
	const size_t before = shares_before(preparation->places, client);
	pthread_mutex_unlock(&preparation->mutex);
	return before;
}

double preparation_ahead_ms(struct preparation *preparation, const char *client)
{
	return render_queue_ahead_ms(preparation->waiting, client, INFINITY);
}

double preparation_busy_ms(const struct preparation *preparation)
{
	double since = preparation->busy_since_ms;
	return since > 0 ? clock_now_ms() - since : 0;
}

double preparation_typical_ms(const struct preparation *preparation)
{
	return preparation->typical_ms;
}
