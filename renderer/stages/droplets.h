/* First half of the optics stage: what droplets scatter, as tables on the GPU. Depends on the droplet size distribution alone; the tables
 * themselves come from the droplet store.
 */
#ifndef STRATUS_RENDERER_STAGES_DROPLETS_H
#define STRATUS_RENDERER_STAGES_DROPLETS_H

#include "renderer/droplet_store.h"
#include "renderer/stages/stage.h"

/* The event table of shaders/lib/optics.glsl. */
enum { EVENT_TABLE_WIDTH = 512, EVENT_TABLE_DEPTHS = 32 };

struct droplets {
	const struct droplet_tables *tables; /* held for this frame only: the store, not the GPU's memory, decides what stays */
	struct texture phase;                /* log2 of P and P_2 over the columns of droplet_tables */
	struct texture
		events; /* over angle and depth, on each other: forward peak, forward blur, residual of reflection and transmission */
};

/* Owned by the cache and valid until droplets_release, once after every frame. NULL (and a log line) when out of memory. Fills the block's
 * extinctions. */
const struct droplets *droplets_get(struct stage_context *context, const struct scene *scene);
void droplets_release(struct stage_context *context);

/* Appends what droplets depend on. */
void droplets_key_add(struct cache_key *key, const struct scene *scene);

#endif
