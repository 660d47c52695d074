/* What a render needs of its droplets, made off the render thread, so that other skies go on while a new distribution is computed.
 *
 * Jobs whose tables are in memory go to the render queue at once. The others wait for one thread that reads or computes their tables; with
 * each, all that waited for the same go on. Clients share the places in that line (shares.h) and its thread. A job holds its tables until
 * it is rendered. So much may be held as the store may keep: past that the thread waits for the renderer.
 */
#ifndef STRATUS_SERVER_PREPARATION_H
#define STRATUS_SERVER_PREPARATION_H

#include "renderer/droplet_store.h"
#include "server/render_queue.h"

struct preparation;

/* limits: of the jobs that wait. The others must outlive it. NULL (and a log line) on failure. */
struct preparation *preparation_create(struct droplet_store *store, struct render_queue *queue, const struct render_queue_limits *limits);

/* Ends, or passes on, all jobs that were taken. Takes NULL. */
void preparation_destroy(struct preparation *preparation);

/* Takes a job over for the render queue. false when that, or the waiting line, is full, or the job's client has its share of the line; the
 * job then stays with the caller. Never waits. Any thread. */
bool preparation_push(struct preparation *preparation, struct render_job *job);

/* Likewise for a job of a request that has been admitted with another: takes it whatever waits already. Any thread. */
void preparation_pass(struct preparation *preparation, struct render_job *job);

/* The renderer needs the job's tables no longer. Once or more for every job; any thread. */
void preparation_release(struct preparation *preparation, struct render_job *job);

/* Ends the waiting jobs that are over. Any thread. */
void preparation_drop_over(struct preparation *preparation);

/* Would a scene have to wait for its droplets? Any thread. */
bool preparation_needs(const struct preparation *preparation, const struct scene *scene);

/* Jobs waiting now, those in the render queue apart, and their pixels. Any thread. */
size_t preparation_depth(struct preparation *preparation);
double preparation_pixels(struct preparation *preparation);

/* Of those: jobs that go before the next of this client, and the time that renders will take of those before its last, as predicted. Any
 * thread. */
size_t preparation_depth_before(struct preparation *preparation, const char *client);
double preparation_ahead_ms(struct preparation *preparation, const char *client);

/* Milliseconds that the job in work has taken so far, 0 when idle, and those of a typical one lately, 0 before the first. Any thread. */
double preparation_busy_ms(const struct preparation *preparation);
double preparation_typical_ms(const struct preparation *preparation);

#endif
