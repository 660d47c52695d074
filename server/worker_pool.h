/* A few threads for work that needs a processor but no GPU: encoding images, computing optics. Any thread.
 *
 * The backlog is bounded, so that frames waiting to be encoded cannot fill the memory.
 */
#ifndef STRATUS_SERVER_WORKER_POOL_H
#define STRATUS_SERVER_WORKER_POOL_H

#include <stdbool.h>
#include <stddef.h>

/* Part of a larger struct that says what is to be done; belongs to its maker, and is not touched after `run` was called. */
struct work {
	void (*run)(struct work *work);
	struct work *next; /* of the pool */
};

struct worker_pool;

/* threads and backlog from 1. NULL (and a log line) on failure. */
struct worker_pool *worker_pool_create(size_t threads, size_t backlog);

/* Does all work that was accepted, then ends. Takes NULL. */
void worker_pool_destroy(struct worker_pool *pool);

/* Hands work over; false at once when the backlog is full. */
bool worker_pool_try(struct worker_pool *pool, struct work *work);

/* Hands work over, waiting for room. Never from the pool's own threads. */
void worker_pool_wait(struct worker_pool *pool, struct work *work);

#endif
