/* The one thread that owns the renderer and with it the OpenGL context. It loads the kernel table, opens the droplet tables, brings
 * the renderer up, then takes jobs from the queue until that is closed and empty. When the context is lost it makes the renderer anew
 * (renderer_care.h) and begins again what was interrupted.
 */
#ifndef STRATUS_SERVER_RENDER_THREAD_H
#define STRATUS_SERVER_RENDER_THREAD_H

#include "renderer/droplet_store.h"
#include "server/config.h"
#include "server/cost_model.h"
#include "server/render_queue.h"
#include "server/renderer_care.h"

enum render_thread_state {
	RENDER_THREAD_STARTING,
	RENDER_THREAD_READY,
	RENDER_THREAD_RECOVERING, /* makes the renderer anew; jobs wait */
	RENDER_THREAD_FAILED
};

struct render_thread;

/* costs: learns from every job. All arguments must outlive the thread. NULL (and a log line) on failure. */
struct render_thread *render_thread_create(const struct config *config, struct render_queue *queue, struct cost_model *costs);

/* Close the queue first: waits until every job in it is done. All droplet tables must have been released. Takes NULL. */
void render_thread_destroy(struct render_thread *thread);

/* Any thread. RENDER_THREAD_FAILED: it did not come up, or not again (the log says why): jobs end without a picture. */
enum render_thread_state render_thread_state(const struct render_thread *thread);

/* Any thread, once the state has been RENDER_THREAD_READY. */
const struct renderer_info *render_thread_info(const struct render_thread *thread); /* another pointer: another device */
const struct kernel *render_thread_kernel(const struct render_thread *thread);
struct droplet_store *render_thread_droplets(const struct render_thread *thread);

/* Bytes of what a stage remembers on the GPU. Any thread, once the state has been RENDER_THREAD_READY and until render_thread_destroy. */
size_t render_thread_cache_bytes(const struct render_thread *thread, enum stage stage);

/* Milliseconds since the running job began or last asked whether it is over, 0 when idle. Any thread. */
double render_thread_busy_ms(const struct render_thread *thread);

/* Has it shown no progress for longer than --hang-ms? Any thread. */
bool render_thread_hangs(const struct render_thread *thread);

/* Any thread, once the state has been RENDER_THREAD_READY. */
struct care_counts render_thread_care(const struct render_thread *thread);

#endif
