#include "server/render_thread.h"

#include "renderer/golden.h"
#include "renderer/log.h"
#include "server/clock.h"
#include "server/kernel_file.h"
#include "server/transfers.h"

#include <limits.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>

/* So many failures on end are taken for a dead context rather than for bad luck. */
enum { FAILURES_MAX = 3 };

/* What has no memory for a picture this small, that of the golden render, has none for any. */
enum { SMALL_PIXELS = GOLDEN_COLUMNS * GOLDEN_ROWS * GOLDEN_BLOCK * GOLDEN_BLOCK };

/* A scene that has the driver reset itself so often is not tried again. */
enum { INTERRUPTIONS_MAX = 2 };

/* So often an idle thread looks after the renderer. */
#define CARE_MS 250.0

struct render_thread {
	const struct config *config;
	struct render_queue *queue;
	struct cost_model *costs;
	pthread_t thread;
	struct kernel *kernel;
	struct droplet_store *droplets;
	struct renderer_care *care;
	_Atomic int state; /* enum render_thread_state; kernel, droplets and care are set before it says READY */
	struct heartbeat heartbeat;
	int failures;               /* on end, that speak against the context */
	int suspicions;             /* likewise, that may be the scenes' own fault */
	struct render_job *pending; /* a reference in the queue that is on its way, or NULL */
	bool is_idle;
	struct transfers transfers;
};

/* --- jobs -------------------------------------------------------------------------------------------------------------------------- */

/* Who asks is alive: what may take minutes, a reference, is no hang as long as it does. */
struct running_job {
	struct render_thread *thread;
	struct render_job *job;
	double pause_ms; /* from when on others may pass */
};

/* So often an idle thread looks for new work while it waits for a picture. */
#define TRAVEL_MS 1.0

static void end_arrived(struct render_thread *thread, double milliseconds);

static bool is_cancelled(void *context)
{
	const struct running_job *running = context;
	end_arrived(running->thread, 0);
	heartbeat_beat(&running->thread->heartbeat);
	return render_job_is_over(running->job);
}

/* While a reference is on its way others of its kind wait for its end, since each takes memory; but for those that end here without a
 * picture. */
static bool may_pass(struct render_job *job, void *context)
{
	(void)context;
	return job->pending || job->directions || job->scene->model.name != MODEL_REFERENCE || render_job_is_over(job);
}

static bool is_paused(void *context)
{
	const struct running_job *running = context;
	const struct render_thread *thread = running->thread;
	return clock_now_ms() >= running->pause_ms &&
	       (render_queue_has(thread->queue, may_pass, NULL) || renderer_care_is_unproven(thread->care));
}

static enum render_result ask_renderer(struct render_thread *thread, struct render_job *job)
{
	struct running_job running = {thread, job, clock_now_ms() + RENDER_TURN_MS};
	if (job->directions)
		return renderer_sky_light(renderer_care_renderer(thread->care), job->scene, job->directions, is_cancelled, &running,
					  &job->light);
	return renderer_start(renderer_care_renderer(thread->care), job->scene, is_cancelled, is_paused, &running, &job->pending,
			      &job->frame);
}

static bool is_small(const struct render_job *job)
{
	const struct scene_output *output = &job->scene->output;
	return !job->directions && (double)output->width * output->height * __builtin_popcount(output->layers) <= SMALL_PIXELS;
}

/* A scene that does not fit, or takes a program that there is not, says nothing about the next one; several of them on end may: then the
 * golden render decides. */
static void count_failure(struct render_thread *thread, const struct render_job *job, enum render_result result)
{
	const bool is_own_fault = result == RENDER_NO_PROGRAM || (result == RENDER_OUT_OF_MEMORY && !is_small(job));
	*(is_own_fault ? &thread->suspicions : &thread->failures) += 1;
}

static enum render_outcome outcome_of(struct render_thread *thread, struct render_job *job, enum render_result result)
{
	if (result == RENDER_CANCELLED)
		return job->outcome;
	if (result == RENDER_OK) {
		thread->failures = thread->suspicions = 0;
		return RENDER_OUTCOME_OK;
	}
	count_failure(thread, job, result);
	return result == RENDER_OUT_OF_MEMORY ? RENDER_OUTCOME_NO_MEMORY : RENDER_OUTCOME_FAILED;
}

/* A job that a lost context interrupted goes back to the queue. */
static bool is_interrupted(struct render_thread *thread, struct render_job *job, enum render_result result)
{
	if (result != RENDER_FAILED || renderer_look() == RENDERER_NOT_LOST || ++job->interruptions >= INTERRUPTIONS_MAX)
		return false;
	renderer_care_count_repeat(thread->care);
	return true;
}

/* What a turn took is its client's to pay. */
static void settle(struct render_thread *thread, struct render_job *job, double took_ms)
{
	job->spent_ms += took_ms;
	render_queue_settle(thread->queue, job, took_ms);
}

/* Ends a job, or has it done again. */
static void end_job(struct render_thread *thread, struct render_job *job, enum render_result result, double took_ms)
{
	settle(thread, job, took_ms);
	if (is_interrupted(thread, job, result)) {
		render_queue_pass(thread->queue, job);
		return;
	}
	job->outcome = outcome_of(thread, job, result);
	if (job->outcome == RENDER_OUTCOME_OK && job->interruptions == 0)
		cost_model_learn(thread->costs, job);
	job->finished(job);
}

/* Ends the jobs whose pictures have arrived, waiting so long for the next. */
static void end_arrived(struct render_thread *thread, double milliseconds)
{
	enum render_result result;
	double took_ms;
	for (struct render_job *job;
	     (job = transfers_take(&thread->transfers, renderer_care_renderer(thread->care), milliseconds, &result, &took_ms));
	     milliseconds = 0)
		end_job(thread, job, result, took_ms);
}

/* What was begun is given back to the renderer even when it is over. */
static enum render_result run_job(struct render_thread *thread, struct render_job *job)
{
	if (!job->pending && render_job_is_over(job))
		return RENDER_CANCELLED;
	if (!job->device || job->device == renderer_care_info(thread->care))
		return ask_renderer(thread, job);
	log_warning("a picture that was promised of another device is refused");
	renderer_drop_pending(&job->pending);
	job->outcome = RENDER_OUTCOME_UNAVAILABLE;
	return RENDER_CANCELLED;
}

/* --- the renderer's troubles ------------------------------------------------------------------------------------------------------- */

/* What was on its way is lost with the renderer: a reference begins again. */
static void forget_pending(struct render_thread *thread)
{
	struct render_job *job = thread->pending;
	thread->pending = NULL;
	if (!job)
		return;
	renderer_care_count_repeat(thread->care);
	renderer_drop_pending(&job->pending); /* whoever drops what is over may do so with the job from here on */
}

/* Pictures that travel arrive, or turn out to be lost. */
static void await_transfers(struct render_thread *thread)
{
	heartbeat_begin(&thread->heartbeat, thread->config->hang_ms);
	while (thread->transfers.count > 0)
		end_arrived(thread, TRAVEL_MS);
	heartbeat_end(&thread->heartbeat);
}

static void recover(struct render_thread *thread, enum care_reason reason)
{
	thread->state = RENDER_THREAD_RECOVERING;
	await_transfers(thread);
	forget_pending(thread);
	thread->failures = thread->suspicions = 0;
	thread->state = renderer_care_rebuild(thread->care, reason) ? RENDER_THREAD_READY : RENDER_THREAD_FAILED;
	if (thread->state == RENDER_THREAD_FAILED)
		log_error("renderer: it cannot be brought up again");
}

/* Is there something to do again, so that the golden render stops? */
static bool has_work(void *context)
{
	struct render_thread *thread = context;
	heartbeat_beat(&thread->heartbeat);
	return render_queue_depth(thread->queue) > 0;
}

static void look_after_renderer(struct render_thread *thread)
{
	const bool is_suspect = thread->suspicions >= FAILURES_MAX;
	enum care_reason reason = renderer_care_look(thread->care, thread->is_idle, is_suspect, has_work, thread);
	if (is_suspect)
		thread->suspicions = 0;
	if (reason == CARE_NONE && thread->failures >= FAILURES_MAX)
		reason = CARE_FAILURES;
	if (reason != CARE_NONE)
		recover(thread, reason);
}

/* --- the queue ----------------------------------------------------------------------------------------------------------------------- */

/* Waits for a job and looks after the renderer meanwhile. NULL once the queue is closed and empty. */
static struct render_job *await_job(struct render_thread *thread)
{
	bool closed = false;
	struct render_job *job = NULL;
	while (!job && !closed && thread->state != RENDER_THREAD_FAILED) {
		job = render_queue_pop_within(thread->queue, CARE_MS, &closed);
		if (job || closed)
			break;
		thread->is_idle = true;
		look_after_renderer(thread);
	}
	thread->is_idle = false;
	return job;
}

static bool is_any(struct render_job *job, void *context)
{
	(void)job, (void)context;
	return true;
}

/* While pictures travel the renderer goes on with what there is to do, and looks for their arrival else. */
static struct render_job *next_while_travelling(struct render_thread *thread)
{
	struct render_job *job = NULL;
	if (thread->transfers.count > 0)
		heartbeat_begin(&thread->heartbeat, thread->config->hang_ms);
	while (!job && thread->transfers.count > 0) {
		job = render_queue_pop_wanted(thread->queue, thread->pending ? may_pass : is_any, NULL);
		if (!job)
			end_arrived(thread, TRAVEL_MS);
	}
	heartbeat_end(&thread->heartbeat);
	return job;
}

/* The next job; while a reference is on its way, which stands in the queue too, one that may pass it, or that itself. */
static struct render_job *next_job(struct render_thread *thread)
{
	struct render_job *job = next_while_travelling(thread);
	if (!job && thread->pending)
		job = render_queue_pop_wanted(thread->queue, may_pass, NULL);
	return job ? job : await_job(thread);
}

static void run_jobs(struct render_thread *thread)
{
	for (struct render_job *job; (job = next_job(thread));) {
		const double start = clock_now_ms();
		const bool was_pending = job->pending;
		heartbeat_begin(&thread->heartbeat, thread->config->hang_ms);
		job->phase = RENDER_PHASE_RENDERING;
		const enum render_result result = run_job(thread, job);
		const bool unfinished = result == RENDER_UNFINISHED;
		const double took = clock_now_ms() - start;
		heartbeat_end(&thread->heartbeat);
		if (unfinished || was_pending)
			thread->pending = unfinished ? job : NULL;
		if (unfinished) {
			settle(thread, job, took);
			render_queue_pass(thread->queue, job);
		} else if (result == RENDER_OK && job->frame.transfer) {
			transfers_add(&thread->transfers, job, start);
		} else {
			end_job(thread, job, result, took);
		}
		end_arrived(thread, 0);
		look_after_renderer(thread);
		if (thread->state == RENDER_THREAD_FAILED)
			return;
	}
}

/* Without a renderer: nobody waits in vain. */
static void refuse_jobs(struct render_thread *thread)
{
	for (struct render_job *job; (job = render_queue_pop(thread->queue));) {
		render_queue_settle(thread->queue, job, 0);
		job->outcome = RENDER_OUTCOME_UNAVAILABLE;
		job->finished(job);
	}
}

static bool open_droplets(struct render_thread *thread)
{
	const struct config *config = thread->config;
	char directory[PATH_MAX];
	struct droplet_store_params params = {.kernel = thread->kernel,
					      .memory_bytes = (size_t)config->droplets_mb << 20,
					      .disk_bytes = (uint64_t)config->droplets_disk_mb << 20};
	if (snprintf(directory, sizeof directory, "%s/droplets", config->state_dir) >= (int)sizeof directory)
		log_warning("state directory %s: its name is too long to keep droplets in it", config->state_dir);
	else if (config->droplets_disk_mb > 0)
		params.directory = directory;
	thread->droplets = droplet_store_create(&params);
	return thread->droplets != NULL;
}

static bool start(struct render_thread *thread)
{
	const struct config *config = thread->config;
	thread->kernel = kernel_file_open(config->kernel, config->state_dir);
	if (!thread->kernel || !open_droplets(thread))
		return false;
	thread->care = renderer_care_create(config, thread->droplets, &thread->heartbeat);
	return thread->care != NULL;
}

static void *thread_main(void *context)
{
	struct render_thread *thread = context;
	double begin = clock_now_ms();
	if (start(thread)) {
		const struct renderer_info *info = renderer_care_info(thread->care);
		log_info("renderer up in %.0f ms: %s, %s, OpenGL %s%s", clock_now_ms() - begin, info->vendor, info->renderer, info->version,
			 info->software ? " (software rendering)" : "");
		cost_model_start(thread->costs, info->software);
		thread->state = RENDER_THREAD_READY;
		run_jobs(thread);
		if (thread->state == RENDER_THREAD_FAILED)
			refuse_jobs(thread);
	} else {
		thread->state = RENDER_THREAD_FAILED;
	}
	if (thread->care)
		renderer_care_close(thread->care);
	return NULL;
}

struct render_thread *render_thread_create(const struct config *config, struct render_queue *queue, struct cost_model *costs)
{
	struct render_thread *thread = calloc(1, sizeof *thread);
	if (!thread) {
		log_error("render_thread_create: out of memory");
		return NULL;
	}
	thread->config = config;
	thread->queue = queue;
	thread->costs = costs;
	if (pthread_create(&thread->thread, NULL, thread_main, thread) != 0) {
		log_error("render_thread_create: pthread_create failed");
		free(thread);
		return NULL;
	}
	return thread;
}

void render_thread_destroy(struct render_thread *thread)
{
	if (!thread)
		return;
	pthread_join(thread->thread, NULL);
	renderer_care_destroy(thread->care);
	droplet_store_destroy(thread->droplets);
	kernel_destroy(thread->kernel);
	free(thread);
}

enum render_thread_state render_thread_state(const struct render_thread *thread)
{
	return (enum render_thread_state)thread->state;
}

const struct renderer_info *render_thread_info(const struct render_thread *thread)
{
	return renderer_care_info(thread->care);
}

const struct kernel *render_thread_kernel(const struct render_thread *thread)
{
	return thread->kernel;
}

struct droplet_store *render_thread_droplets(const struct render_thread *thread)
{
	return thread->droplets;
}

size_t render_thread_cache_bytes(const struct render_thread *thread, enum stage stage)
{
	return renderer_care_cache_bytes(thread->care, stage);
}

double render_thread_busy_ms(const struct render_thread *thread)
{
	return heartbeat_silence_ms(&thread->heartbeat);
}

bool render_thread_hangs(const struct render_thread *thread)
{
	return heartbeat_is_overdue(&thread->heartbeat);
}

struct care_counts render_thread_care(const struct render_thread *thread)
{
	return renderer_care_counts(thread->care);
}
