/* The sun on the height field, for views from above: the shadow that it throws over itself, and what its slopes receive
 * (shaders/lib/height_sun.glsl).
 *
 * Depends on the height field, the sun's direction and the droplets' extinction. Shadows are found by doubling: what they reach over twice
 * a distance is the higher of two reaches of half of it. The light that is scattered often spreads sideways before it comes out again; its
 * mean over the tile is that of the beams which the layer holds up, so that slopes share the light out and make none: a closed deck
 * receives what a plane does. A low sun lights the sides of broken cloud and leaves other parts in shade (Varnai and Davies 1999, J. Atmos.
 * Sci., on the horizontal transport effect), so that it catches more than its columns would.
 */
#ifndef STRATUS_RENDERER_STAGES_HEIGHT_LIGHT_H
#define STRATUS_RENDERER_STAGES_HEIGHT_LIGHT_H

#include "renderer/stages/stage.h"

enum { HEIGHT_LIGHT_PASS_COUNT = 3 };

struct height_light_stage {
	struct pass *passes[HEIGHT_LIGHT_PASS_COUNT];
};

bool height_light_init(struct height_light_stage *stage, const struct pass_compiler *compiler);
void height_light_finish(struct height_light_stage *stage);

/* surface: x, y slopes; z height above which there is no shadow, m; w light received that is scattered often, over that of a plane. near:
 * the same of light that is scattered a few times, which comes out near where it went in. */
struct height_light {
	struct texture surface, near;
};

/* height: the field's pyramid. Wants the block with sun, clouds and extinction uploaded. The tables belong to the cache and are valid for
 * this frame. NULL when out of memory. */
const struct height_light *height_light_get(const struct height_light_stage *stage, struct stage_context *context,
					    const struct scene *scene, const struct texture *height);

#endif
