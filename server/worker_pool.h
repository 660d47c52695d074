/* A few threads for work that needs a processor but no GPU: encoding images, computing optics, tracing photons. Any thread.
 *
 * The backlog is bounded, so that frames waiting to be encoded cannot fill the memory. Clients share the places in it (shares.h) and the
 * threads' time (fair_order.h); what is of one client, or of nobody, runs in the order in which it came.
 */
#ifndef STRATUS_SERVER_WORKER_POOL_H
#define STRATUS_SERVER_WORKER_POOL_H

#include <stdbool.h>
#include <stddef.h>

/* Part of a larger struct that says what is to be done; belongs to its maker, and is not touched after `run` was called. */
struct work {
	void (*run)(struct work *work);
	bool (*is_over)(struct work *work); /* late, or does nobody wait for it any more? Quick; NULL: never */
	const char *client;                 /* key of whom it is for, read while it is handed over. NULL: nobody's in particular */
};

struct worker_pool;

/* threads and backlog from 1; nice: how far the threads, and those they make, stand back behind others, 0..19. NULL (and a log line) on
 * failure. */
struct worker_pool *worker_pool_create(size_t threads, size_t backlog, int nice);

/* Does all work that was accepted, then ends. Takes NULL. */
void worker_pool_destroy(struct worker_pool *pool);

/* Hands work over; false at once when the backlog is full, or its client has its share of it. */
bool worker_pool_try(struct worker_pool *pool, struct work *work);

/* Hands work over, waiting for room, whatever its client's share. Never from the pool's own threads. */
void worker_pool_wait(struct worker_pool *pool, struct work *work);

/* Runs waiting work that is over at once, by the caller. */
void worker_pool_sweep(struct worker_pool *pool);

/* Work that waits now. */
size_t worker_pool_waiting(struct worker_pool *pool);

#endif
