/* Puffs on the cloud tops seen from above, from about a hundred metres down to about ten: what the height field's texels do not resolve.
 *
 * A periodic volume of how far the surface bulges at a place (shaders/lib/height_detail.glsl): cells upon cells, rounded outside with
 * creases between. It is the same for all scenes; those shift it, and time carries it up through the tops, so that puffs well up and go
 * under.
 */
#ifndef STRATUS_RENDERER_STAGES_HEIGHT_PUFFS_H
#define STRATUS_RENDERER_STAGES_HEIGHT_PUFFS_H

#include "renderer/scene.h"
#include "renderer/stages/stage.h"

struct height_puffs {
	struct texture volume; /* how far the surface bulges, and how that rises along the axes, with means over ever larger cubes */
	struct texture layers; /* the first alone, four planes side by side in a texel: cheap to look up */
};

/* Texels a side of the height field that they stand on. */
int height_puffs_field_side(const struct scene_clouds *clouds);

/* 0: the field has no puffs; 1: it has; 2: these are so large that smaller ones stand on them. As HEIGHT_NEAR in
 * shaders/lib/height_detail.glsl.
 */
int height_puffs_octaves(const struct scene_clouds *clouds);

/* Fills in the block's cloud_puffs and cloud_puffs_drift. */
void height_puffs_fill_block(struct scene_block *block, const struct scene_clouds *clouds);

/* Valid for this frame. NULL when out of memory. */
const struct height_puffs *height_puffs_get(struct stage_context *context);

#endif
