/* What the stages share: compiler of their passes, memory, and the uniform block that they fill one after the other.
 *
 * A stage is a function of named parts of the scene. It looks up its result in the cache, under those parts alone, computes what is
 * missing, and writes what later stages need into the block. All stages run on the thread that owns the context.
 */
#ifndef STRATUS_RENDERER_STAGES_STAGE_H
#define STRATUS_RENDERER_STAGES_STAGE_H

#include "renderer/cache.h"
#include "renderer/gl/pass.h"
#include "renderer/gl/texture.h"
#include "renderer/scene.h"
#include "renderer/scene_block.h"

struct stage_context {
	struct cache *cache;
	struct scene_block block;
	unsigned block_buffer; /* OpenGL name of the uniform buffer */
	struct droplet_store *droplets;
	const struct droplet_tables *tables; /* of the frame's droplets, held (droplets_get, droplets_release) */
	bool reused;                         /* set false by a stage that computed anything */
	renderer_cancelled *cancelled;       /* asked by stage_is_stopped; NULL: nobody is to be asked */
	void *cancel_context;
	bool stopped; /* by whom was asked: nothing of this frame is wanted any more, and what is unfinished must not be kept */
};

/* To be asked between passes that take long: is there no use in going on? Waits for the passes so far, since those that are only queued
 * would be done all the same. Once true it stays so; the stage then fails. */
bool stage_is_stopped(struct stage_context *context);

/* false, after a line that there was no memory for what the stage computes, unless it was stopped. */
bool stage_fails(const struct stage_context *context, const char *stage);

/* Makes the block as it stands visible to the passes that follow. */
void stage_upload_block(struct stage_context *context);

/* Reads one level of a float texture back: `components` (1 or 4) floats a texel. Waits for the GPU: for small results alone. */
void stage_read_texture(const struct texture *texture, int level, int components, float *values);

/* Appends all of a scene that its light depends on: everything but camera and output. */
void stage_key_add_light(struct cache_key *key, const struct scene *scene);

/* Appends the content of a map; NULL counts too. */
void stage_key_add_map(struct cache_key *key, const struct scene_map *map);

/* Creates a list of passes; all or none. */
bool stage_create_passes(const struct pass_compiler *compiler, const struct pass_desc *descs, struct pass **passes, int count);
void stage_destroy_passes(struct pass **passes, int count);

#endif
