#include "server/render_queue.h"

#include "renderer/log.h"
#include "server/clock.h"

#include <pthread.h>
#include <stdlib.h>

struct render_queue {
	pthread_mutex_t mutex;
	pthread_cond_t changed;
	struct render_job *first, **last;
	size_t depth, limit;
	double pixels;
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

struct render_queue *render_queue_create(size_t limit)
{
	struct render_queue *queue = calloc(1, sizeof *queue);
	if (!queue) {
		log_error("render_queue_create: out of memory");
		return NULL;
	}
	pthread_mutex_init(&queue->mutex, NULL);
	pthread_cond_init(&queue->changed, NULL);
	queue->last = &queue->first;
	queue->limit = limit;
	return queue;
}

void render_queue_destroy(struct render_queue *queue)
{
	if (!queue)
		return;
	pthread_cond_destroy(&queue->changed);
	pthread_mutex_destroy(&queue->mutex);
	free(queue);
}

static double pixels_of(const struct render_job *job)
{
	const struct scene_output *output = &job->scene->output;
	const int layers = output->format == IMAGE_PNG ? 1 : __builtin_popcount(output->layers);
	return job->directions ? 0 : (double)output->width * output->height * layers;
}

static void append(struct render_queue *queue, struct render_job *job)
{
	job->queued_ms = clock_now_ms();
	job->next = NULL;
	*queue->last = job;
	queue->last = &job->next;
	queue->depth++;
	queue->pixels += pixels_of(job);
	pthread_cond_signal(&queue->changed);
}

bool render_queue_push(struct render_queue *queue, struct render_job *job)
{
	pthread_mutex_lock(&queue->mutex);
	bool accepted = !queue->closed && queue->depth < queue->limit;
	if (accepted)
		append(queue, job);
	pthread_mutex_unlock(&queue->mutex);
	return accepted;
}

void render_queue_pass(struct render_queue *queue, struct render_job *job)
{
	pthread_mutex_lock(&queue->mutex);
	append(queue, job);
	pthread_mutex_unlock(&queue->mutex);
}

/* Takes the job out that `link` leads to; NULL when it leads to none. */
static struct render_job *take(struct render_queue *queue, struct render_job **link)
{
	struct render_job *job = *link;
	if (!job)
		return NULL;
	*link = job->next;
	if (!*link)
		queue->last = link;
	queue->depth--;
	queue->pixels -= pixels_of(job);
	job->waited_ms += clock_now_ms() - job->queued_ms;
	return job;
}

struct render_job *render_queue_pop(struct render_queue *queue)
{
	pthread_mutex_lock(&queue->mutex);
	while (!queue->first && !queue->closed)
		pthread_cond_wait(&queue->changed, &queue->mutex);
	struct render_job *job = take(queue, &queue->first);
	pthread_mutex_unlock(&queue->mutex);
	return job;
}

struct render_job *render_queue_pop_wanted(struct render_queue *queue, render_job_wanted *wanted, void *context)
{
	pthread_mutex_lock(&queue->mutex);
	struct render_job **link = &queue->first;
	while (*link && !wanted(*link, context))
		link = &(*link)->next;
	struct render_job *job = take(queue, link);
	pthread_mutex_unlock(&queue->mutex);
	return job;
}

bool render_queue_has(struct render_queue *queue, render_job_wanted *wanted, void *context)
{
	pthread_mutex_lock(&queue->mutex);
	struct render_job *job = queue->first;
	while (job && !wanted(job, context))
		job = job->next;
	pthread_mutex_unlock(&queue->mutex);
	return job;
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
