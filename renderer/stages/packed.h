/* Periodic pictures of one number in the form that software renderers read fastest: shaders/lib/packed.glsl. */
#ifndef STRATUS_RENDERER_STAGES_PACKED_H
#define STRATUS_RENDERER_STAGES_PACKED_H

#include "renderer/stages/stage.h"

/* NULL after log lines. */
struct pass *packed_pass_create(const struct pass_compiler *compiler);

/* The packed form of a square picture with all its levels, a power of two a side. Looked up under `key`, which says what the picture was
 * made from; made when missing. Owned by the cache, valid for this frame. NULL (and a log line) when out of memory. */
const struct texture *packed_get(const struct pass *pack, struct stage_context *context, const struct cache_key *key,
				 const struct texture *picture, enum texture_format format);

#endif
