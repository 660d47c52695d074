/* The sun on the columns of a broken layer, for views from below (shaders/lib/side_light.glsl): what its beam passes on its slant way to
 * the base, and how much light that is scattered often there is at the base and at the sides, relative to a layer of that thickness.
 *
 * Depends on the thickness, the sun's direction and the droplets' extinction. Where the layer is even the light is the slab's.
 */
#ifndef STRATUS_RENDERER_STAGES_SIDE_LIGHT_H
#define STRATUS_RENDERER_STAGES_SIDE_LIGHT_H

#include "renderer/stages/stage.h"

enum { SIDE_LIGHT_PASS_COUNT = 2 };

struct side_light_stage {
	struct pass *passes[SIDE_LIGHT_PASS_COUNT];
};

bool side_light_init(struct side_light_stage *stage, const struct pass_compiler *compiler);
void side_light_finish(struct side_light_stage *stage);

/* thickness: of the layer over the tile, m, with levels. Wants the block with sun, clouds and extinction uploaded. The table (x thickness
 * evened out, m; y, z light that is scattered often at the base and at the sides, of the flux on the top; w thickness on the beam's way to
 * the base, m) belongs to the cache and is valid for this frame. NULL when out of memory. */
const struct texture *side_light_get(const struct side_light_stage *stage, struct stage_context *context, const struct scene *scene,
				     const struct texture *thickness);

#endif
