/* Second half of the optics stage: what a layer of the droplets does with light, for one sun elevation, as tables on the GPU.
 *
 * Rows over thickness serve fluxes (radiosity, shadows) and diffuse light in both shadings; slices hold the solved radiance of the orders
 * from the second on, for the suns' elevations that the layer has between the camera and its horizon.
 */
#ifndef STRATUS_RENDERER_STAGES_SLAB_TABLES_H
#define STRATUS_RENDERER_STAGES_SLAB_TABLES_H

#include "renderer/stages/droplets.h"

/* As in shaders/lib/slab.glsl. */
enum { SLAB_TABLE_WIDTH = 256, SLAB_TABLE_SINGLE = 6, SLAB_TABLE_HEIGHT = SLAB_TABLE_SINGLE + SLAB_SLICE_VIEW_COUNT };

/* Both owned by the cache, valid for this frame. NULL (and a log line) when out of memory. */

/* Columns: square root of H over its maximum. Rows: diffuse T, scale of I2_t, diffuse R, scale of I2_r, directional T, spherical albedo;
 * then for each view index the share of diffuse light that goes through, of that which meets droplets. */
const struct texture *slab_rows_get(struct stage_context *context, const struct scene *scene, const struct droplets *droplets);

/* Slices of mu_l, one after the other along the third axis, those of the second lit side behind those of the first. Fills the block's
 * slab_slice_range and slab_light. In the paper's shading there are none: *slices is NULL. false when out of memory. */
bool slab_slices_get(struct stage_context *context, const struct scene *scene, const struct droplets *droplets,
		     const struct texture **slices);

/* Cosine of the sun at a coordinate of the slices, as in slab_slice_range: dense at zenith and horizon. */
double slab_slices_cosine(double coordinate);

#endif
