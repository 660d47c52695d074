#include "server/render_queue.h"

#include "renderer/log.h"
#include "server/clock.h"

#include <math.h>
#include <pthread.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

/* What is unknown counts for so much. */
#define UNKNOWN_MS 1.0

struct render_queue {
	pthread_mutex_t mutex;
	pthread_cond_t changed;
	struct fair_order *order;
	struct render_queue_limits limits;
	size_t depth;
	double pixels, waiting_ms;
	unsigned long running_flight;                         /* of the job that runs */
	double running_ms, running_turn_ms, running_since_ms; /* predicted of the job that runs, 0: none does; and of its turn */
	bool closed;
};

bool render_job_is_over(struct render_job *job)
{
	/* In this order: who joins after the question has moved the deadline, or is told that the job is over. */
	const double now_ms = clock_now_ms();
	const bool abandoned = job->abandoned(job), expired = now_ms >= job->deadline_ms, over = expired || abandoned;
	if (over)
		job->outcome = expired ? RENDER_OUTCOME_EXPIRED : RENDER_OUTCOME_ABANDONED;
	return over;
}

struct render_queue *render_queue_create(const struct render_queue_limits *limits)
{
	struct render_queue *queue = calloc(1, sizeof *queue);
	struct fair_order *order = fair_order_create();
	if (!queue || !order) {
		log_error("render_queue_create: out of memory");
		fair_order_destroy(order);
		free(queue);
		return NULL;
	}
	pthread_mutex_init(&queue->mutex, NULL);
	pthread_condattr_t monotonic;
	pthread_condattr_init(&monotonic);
	pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
	pthread_cond_init(&queue->changed, &monotonic);
	pthread_condattr_destroy(&monotonic);
	queue->order = order;
	queue->limits = *limits;
	return queue;
}

void render_queue_destroy(struct render_queue *queue)
{
	if (!queue)
		return;
	pthread_cond_destroy(&queue->changed);
	pthread_mutex_destroy(&queue->mutex);
	fair_order_destroy(queue->order);
	free(queue);
}

static struct render_job *job_of(struct fair_entry *entry)
{
	return entry ? (struct render_job *)((char *)entry - offsetof(struct render_job, entry)) : NULL;
}

static double pixels_of(const struct render_job *job)
{
	const struct scene_output *output = &job->scene->output;
	const int layers = output->format == IMAGE_PNG ? 1 : __builtin_popcount(output->layers);
	return job->directions ? 0 : (double)output->width * output->height * layers;
}

static double remaining_ms(const struct render_job *job)
{
	return fmax(job->predicted_ms - job->spent_ms, UNKNOWN_MS);
}

/* A reference takes its turns like any picture. */
static double turn_ms(const struct render_job *job)
{
	const bool turns = !job->directions && job->scene->model.name == MODEL_REFERENCE;
	return turns ? fmin(remaining_ms(job), RENDER_TURN_MS) : remaining_ms(job);
}

static void append(struct render_queue *queue, struct render_job *job)
{
	job->queued_ms = clock_now_ms();
	job->entry.client = job->client;
	job->entry.cost_ms = turn_ms(job);
	fair_order_add(queue->order, &job->entry, job->queued_ms);
	queue->depth++;
	queue->pixels += pixels_of(job);
	queue->waiting_ms += remaining_ms(job);
	pthread_cond_signal(&queue->changed);
}

static enum render_refusal refusal_of(const struct render_queue *queue, const struct render_job *job)
{
	if (queue->closed)
		return RENDER_REFUSED_CLOSED;
	if (queue->depth >= queue->limits.jobs)
		return RENDER_REFUSED_COUNT;
	return queue->depth > 0 && queue->pixels + pixels_of(job) > queue->limits.pixels ? RENDER_REFUSED_PIXELS : RENDER_TAKEN;
}

bool render_queue_push(struct render_queue *queue, struct render_job *job)
{
	pthread_mutex_lock(&queue->mutex);
	const enum render_refusal refusal = refusal_of(queue, job);
	job->refusal = refusal;
	if (refusal == RENDER_TAKEN)
		append(queue, job);
	pthread_mutex_unlock(&queue->mutex);
	return refusal == RENDER_TAKEN;
}

void render_queue_pass(struct render_queue *queue, struct render_job *job)
{
	pthread_mutex_lock(&queue->mutex);
	append(queue, job);
	pthread_mutex_unlock(&queue->mutex);
}

static void count_out(struct render_queue *queue, struct render_job *job)
{
	queue->depth--;
	queue->pixels -= pixels_of(job);
	queue->waiting_ms = queue->depth ? queue->waiting_ms - remaining_ms(job) : 0;
	job->waited_ms += clock_now_ms() - job->queued_ms;
}

struct wish {
	render_job_wanted *wanted;
	void *context;
};

static bool is_wanted(struct fair_entry *entry, void *context)
{
	const struct wish *wish = context;
	return wish->wanted(job_of(entry), wish->context);
}

/* The next of the jobs; wanted NULL: of all. */
static struct render_job *first(struct render_queue *queue, render_job_wanted *wanted, void *context)
{
	struct wish wish = {wanted, context};
	return job_of(fair_order_first(queue->order, wanted ? is_wanted : NULL, &wish));
}

static struct render_job *take(struct render_queue *queue, struct render_job *job)
{
	if (!job)
		return NULL;
	count_out(queue, job);
	queue->running_flight = job->flight;
	queue->running_ms = remaining_ms(job);
	queue->running_turn_ms = job->entry.cost_ms;
	queue->running_since_ms = clock_now_ms();
	fair_order_take(queue->order, &job->entry);
	return job;
}

struct render_job *render_queue_pop(struct render_queue *queue)
{
	pthread_mutex_lock(&queue->mutex);
	while (!queue->depth && !queue->closed)
		pthread_cond_wait(&queue->changed, &queue->mutex);
	struct render_job *job = take(queue, first(queue, NULL, NULL));
	pthread_mutex_unlock(&queue->mutex);
	return job;
}

struct render_job *render_queue_pop_within(struct render_queue *queue, double milliseconds, bool *closed)
{
	const double until_ms = clock_now_ms() + milliseconds;
	const struct timespec until = {.tv_sec = (time_t)(until_ms * 1e-3), .tv_nsec = (long)(fmod(until_ms, 1e3) * 1e6)};
	pthread_mutex_lock(&queue->mutex);
	while (!queue->depth && !queue->closed && pthread_cond_timedwait(&queue->changed, &queue->mutex, &until) == 0)
		;
	struct render_job *job = take(queue, first(queue, NULL, NULL));
	*closed = !job && queue->closed;
	pthread_mutex_unlock(&queue->mutex);
	return job;
}

struct render_job *render_queue_pop_wanted(struct render_queue *queue, render_job_wanted *wanted, void *context)
{
	pthread_mutex_lock(&queue->mutex);
	struct render_job *job = take(queue, first(queue, wanted, context));
	pthread_mutex_unlock(&queue->mutex);
	return job;
}

void render_queue_settle(struct render_queue *queue, struct render_job *job, double took_ms)
{
	pthread_mutex_lock(&queue->mutex);
	fair_order_settle(queue->order, &job->entry, took_ms);
	queue->running_ms = queue->running_turn_ms = 0;
	queue->running_flight = 0;
	pthread_mutex_unlock(&queue->mutex);
}

struct render_job *render_queue_remove(struct render_queue *queue, render_job_wanted *wanted, void *context)
{
	pthread_mutex_lock(&queue->mutex);
	struct render_job *job = first(queue, wanted, context);
	if (job) {
		count_out(queue, job);
		fair_order_drop(queue->order, &job->entry);
	}
	pthread_mutex_unlock(&queue->mutex);
	return job;
}

static bool is_of_flight(struct fair_entry *entry, void *context)
{
	return job_of(entry)->flight == *(const unsigned long *)context;
}

void render_queue_share(struct render_queue *queue, unsigned long flight, const char *client)
{
	pthread_mutex_lock(&queue->mutex);
	struct render_job *job = job_of(fair_order_first(queue->order, is_of_flight, &flight));
	if (job && fair_order_share(queue->order, &job->entry, client, clock_now_ms())) {
		snprintf(job->line, sizeof job->line, "%s", client); /* the client may leave before its job ends */
		job->client = job->entry.client = job->line;
	}
	pthread_mutex_unlock(&queue->mutex);
}

/* What a prediction leaves of the job that runs. */
static double left_ms(const struct render_queue *queue, double predicted_ms)
{
	return predicted_ms > 0 ? fmax(predicted_ms - (clock_now_ms() - queue->running_since_ms), 0) : 0;
}

bool render_queue_foresee(struct render_queue *queue, unsigned long flight, const char *client, double *ahead_ms, double *own_ms)
{
	pthread_mutex_lock(&queue->mutex);
	const struct render_job *job = job_of(fair_order_first(queue->order, is_of_flight, &flight));
	const bool runs = !job && queue->running_flight == flight;
	if (job) {
		*ahead_ms =
			fair_order_ahead_of_ms(queue->order, &job->entry, client, clock_now_ms()) + left_ms(queue, queue->running_turn_ms);
		*own_ms = remaining_ms(job);
	} else {
		*ahead_ms = 0;
		*own_ms = runs ? left_ms(queue, queue->running_ms) : 0;
	}
	pthread_mutex_unlock(&queue->mutex);
	return job || runs;
}

bool render_queue_has(struct render_queue *queue, render_job_wanted *wanted, void *context)
{
	pthread_mutex_lock(&queue->mutex);
	const bool has = first(queue, wanted, context);
	pthread_mutex_unlock(&queue->mutex);
	return has;
}

void render_queue_close(struct render_queue *queue)
{
	pthread_mutex_lock(&queue->mutex);
	queue->closed = true;
	pthread_cond_broadcast(&queue->changed);
	pthread_mutex_unlock(&queue->mutex);
}

size_t render_queue_depth(struct render_queue *queue)
{
	pthread_mutex_lock(&queue->mutex);
	size_t depth = queue->depth;
	pthread_mutex_unlock(&queue->mutex);
	return depth;
}

double render_queue_pixels(struct render_queue *queue)
{
	pthread_mutex_lock(&queue->mutex);
	double pixels = queue->pixels;
	pthread_mutex_unlock(&queue->mutex);
	return pixels;
}

double render_queue_backlog_ms(struct render_queue *queue)
{
	pthread_mutex_lock(&queue->mutex);
	const double backlog_ms = queue->waiting_ms + left_ms(queue, queue->running_ms);
	pthread_mutex_unlock(&queue->mutex);
	return backlog_ms;
}

double render_queue_ahead_ms(struct render_queue *queue, const char *client, double cost_ms)
{
	pthread_mutex_lock(&queue->mutex);
	const double now_ms = clock_now_ms();
	const double ahead_ms = fair_order_ahead_ms(queue->order, client, cost_ms, now_ms) + left_ms(queue, queue->running_turn_ms);
	pthread_mutex_unlock(&queue->mutex);
	return ahead_ms;
}
