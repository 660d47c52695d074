#include "server/worker_pool.h"

#include "renderer/log.h"

#include <pthread.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

struct worker_pool {
	pthread_mutex_t mutex;
	pthread_cond_t arrived, left;
	struct work *first, **last;
	size_t waiting, backlog;
	int nice;
	bool closed;
	size_t thread_count;
	pthread_t threads[];
};

static struct work *take_work(struct worker_pool *pool)
{
	pthread_mutex_lock(&pool->mutex);
	while (!pool->first && !pool->closed)
		pthread_cond_wait(&pool->arrived, &pool->mutex);
	struct work *work = pool->first;
	if (work) {
		pool->first = work->next;
		if (!pool->first)
			pool->last = &pool->first;
		pool->waiting--;
		pthread_cond_signal(&pool->left);
	}
	pthread_mutex_unlock(&pool->mutex);
	return work;
}

static void *work_until_closed(void *context)
{
	const struct worker_pool *pool = context;
	if (pool->nice > 0 && setpriority(PRIO_PROCESS, (id_t)gettid(), pool->nice) != 0)
		log_warning("worker_pool: setpriority failed");
	for (struct work *work; (work = take_work(context));)
		work->run(work);
	return NULL;
}

struct worker_pool *worker_pool_create(size_t threads, size_t backlog, int nice)
{
	struct worker_pool *pool = calloc(1, sizeof *pool + threads * sizeof *pool->threads);
	if (!pool) {
		log_error("worker_pool_create: out of memory");
		return NULL;
	}
	pthread_mutex_init(&pool->mutex, NULL);
	pthread_cond_init(&pool->arrived, NULL);
	pthread_cond_init(&pool->left, NULL);
	pool->last = &pool->first;
	pool->backlog = backlog;
	pool->nice = nice;
	while (pool->thread_count < threads) {
		if (pthread_create(&pool->threads[pool->thread_count], NULL, work_until_closed, pool) != 0) {
			log_error("worker_pool_create: pthread_create failed");
			worker_pool_destroy(pool);
			return NULL;
		}
		pool->thread_count++;
	}
	return pool;
}

void worker_pool_destroy(struct worker_pool *pool)
{
	if (!pool)
		return;
	pthread_mutex_lock(&pool->mutex);
	pool->closed = true;
	pthread_cond_broadcast(&pool->arrived);
	pthread_mutex_unlock(&pool->mutex);
	for (size_t i = 0; i < pool->thread_count; i++)
		pthread_join(pool->threads[i], NULL);
	pthread_cond_destroy(&pool->left);
	pthread_cond_destroy(&pool->arrived);
	pthread_mutex_destroy(&pool->mutex);
	free(pool);
}

static void append(struct worker_pool *pool, struct work *work)
{
	work->next = NULL;
	*pool->last = work;
	pool->last = &work->next;
	pool->waiting++;
	pthread_cond_signal(&pool->arrived);
}

bool worker_pool_try(struct worker_pool *pool, struct work *work)
{
	pthread_mutex_lock(&pool->mutex);
	bool accepted = pool->waiting < pool->backlog;
	if (accepted)
		append(pool, work);
	pthread_mutex_unlock(&pool->mutex);
	return accepted;
}

void worker_pool_wait(struct worker_pool *pool, struct work *work)
{
	pthread_mutex_lock(&pool->mutex);
	while (pool->waiting >= pool->backlog)
		pthread_cond_wait(&pool->left, &pool->mutex);
	append(pool, work);
	pthread_mutex_unlock(&pool->mutex);
}

/* Takes one piece of work that is over out of those that wait. */
static struct work *take_over(struct worker_pool *pool)
{
	pthread_mutex_lock(&pool->mutex);
	struct work **link = &pool->first;
	while (*link && !((*link)->is_over && (*link)->is_over(*link)))
		link = &(*link)->next;
	struct work *work = *link;
	if (work) {
		*link = work->next;
		if (!*link)
			pool->last = link;
		pool->waiting--;
		pthread_cond_signal(&pool->left);
	}
	pthread_mutex_unlock(&pool->mutex);
	return work;
}

void worker_pool_sweep(struct worker_pool *pool)
{
	for (struct work *work; (work = take_over(pool));)
		work->run(work);
}

size_t worker_pool_waiting(struct worker_pool *pool)
{
	pthread_mutex_lock(&pool->mutex);
	size_t waiting = pool->waiting;
	pthread_mutex_unlock(&pool->mutex);
	return waiting;
}
