#include "server/worker_pool.h"

#include "renderer/log.h"
#include "server/client_address.h"
#include "server/clock.h"
#include "server/fair_order.h"
#include "server/shares.h"

#include <pthread.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

/* Nobody knows before how long work takes: it counts for so much until it has ended, and then for what it took. */
#define EXPECTED_MS 1.0

/* Of work that waits or runs: the work itself may be gone before its client has paid for it. */
struct place {
	struct fair_entry entry;
	struct work *work;
	struct place *next; /* free */
	const char *client; /* NULL, or key */
	char key[CLIENT_KEY_SIZE];
};

struct worker_pool {
	pthread_mutex_t mutex;
	pthread_cond_t arrived, left;
	struct fair_order *order;
	struct shares *waiting;
	struct place *places, *free; /* as many as may wait and run */
	size_t backlog;
	int nice;
	bool closed;
	size_t thread_count;
	pthread_t threads[];
};

static struct place *place_of(struct fair_entry *entry)
{
	return entry ? (struct place *)((char *)entry - offsetof(struct place, entry)) : NULL;
}

/* Within the mutex. */
static void leave_line(struct worker_pool *pool, const struct place *place)
{
	shares_give(pool->waiting, place->client);
	pthread_cond_signal(&pool->left);
}

static void free_place(struct worker_pool *pool, struct place *place)
{
	place->next = pool->free;
	pool->free = place;
}

static struct place *take_place(struct worker_pool *pool)
{
	pthread_mutex_lock(&pool->mutex);
	while (!shares_taken(pool->waiting) && !pool->closed)
		pthread_cond_wait(&pool->arrived, &pool->mutex);
	struct place *place = place_of(fair_order_first(pool->order, NULL, NULL));
	if (place) {
		fair_order_take(pool->order, &place->entry);
		leave_line(pool, place);
	}
	pthread_mutex_unlock(&pool->mutex);
	return place;
}

static void settle(struct worker_pool *pool, struct place *place, double took_ms)
{
	pthread_mutex_lock(&pool->mutex);
	fair_order_settle(pool->order, &place->entry, took_ms);
	free_place(pool, place);
	pthread_mutex_unlock(&pool->mutex);
}

static void *work_until_closed(void *context)
{
	const struct worker_pool *pool = context;
	if (pool->nice > 0 && setpriority(PRIO_PROCESS, (id_t)gettid(), pool->nice) != 0)
		log_warning("worker_pool: setpriority failed");
	for (struct place *place; (place = take_place(context));) {
		const double start_ms = clock_now_ms();
		place->work->run(place->work);
		settle(context, place, clock_now_ms() - start_ms);
	}
	return NULL;
}

static bool start_threads(struct worker_pool *pool, size_t threads)
{
	while (pool->thread_count < threads && pthread_create(&pool->threads[pool->thread_count], NULL, work_until_closed, pool) == 0)
		pool->thread_count++;
	return pool->thread_count == threads;
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
	pool->backlog = backlog;
	pool->nice = nice;
	pool->order = fair_order_create();
	pool->waiting = shares_create(backlog);
	pool->places = calloc(backlog + threads, sizeof *pool->places);
	for (size_t i = 0; pool->places && i < backlog + threads; i++)
		free_place(pool, &pool->places[i]);
	if (pool->order && pool->waiting && pool->places && start_threads(pool, threads))
		return pool;
	log_error("worker_pool_create: no memory or no thread");
	worker_pool_destroy(pool);
	return NULL;
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
	fair_order_destroy(pool->order);
	shares_destroy(pool->waiting);
	free(pool->places);
	pthread_cond_destroy(&pool->left);
	pthread_cond_destroy(&pool->arrived);
	pthread_mutex_destroy(&pool->mutex);
	free(pool);
}

/* There is room. Within the mutex. */
static void append(struct worker_pool *pool, struct work *work)
{
	struct place *place = pool->free;
	pool->free = place->next;
	place->work = work;
	place->client = work->client ? place->key : NULL;
	snprintf(place->key, sizeof place->key, "%s", work->client ? work->client : "");
	place->entry = (struct fair_entry){.client = place->key, .cost_ms = EXPECTED_MS};
	fair_order_add(pool->order, &place->entry, clock_now_ms());
	shares_take(pool->waiting, place->client);
	pthread_cond_signal(&pool->arrived);
}

bool worker_pool_try(struct worker_pool *pool, struct work *work)
{
	pthread_mutex_lock(&pool->mutex);
	const bool accepted = shares_allow(pool->waiting, work->client);
	if (accepted)
		append(pool, work);
	pthread_mutex_unlock(&pool->mutex);
	return accepted;
}

void worker_pool_wait(struct worker_pool *pool, struct work *work)
{
	pthread_mutex_lock(&pool->mutex);
	while (shares_taken(pool->waiting) >= pool->backlog)
		pthread_cond_wait(&pool->left, &pool->mutex);
	append(pool, work);
	pthread_mutex_unlock(&pool->mutex);
}

static bool is_over(struct fair_entry *entry, void *context)
{
	(void)context;
	struct work *work = place_of(entry)->work;
	return work->is_over && work->is_over(work);
}

/* Takes one piece of work that is over out of those that wait. */
static struct work *take_over(struct worker_pool *pool)
{
	pthread_mutex_lock(&pool->mutex);
	struct place *place = place_of(fair_order_first(pool->order, is_over, NULL));
	struct work *work = place ? place->work : NULL;
	if (place) {
		fair_order_drop(pool->order, &place->entry);
		leave_line(pool, place);
		free_place(pool, place);
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
	const size_t waiting = shares_taken(pool->waiting);
	pthread_mutex_unlock(&pool->mutex);
	return waiting;
}
