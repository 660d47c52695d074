/* What each pixel of a picture shows, told by the slab's layers of the same scene and by the pixel's ray. Any thread. */
#ifndef STRATUS_RENDERER_IMAGE_REGIONS_H
#define STRATUS_RENDERER_IMAGE_REGIONS_H

#include "renderer/renderer.h"

#include <stdint.h>

/* Every pixel is one of cloud, sky and ground, but for those that show the sun's disc, whose light would cover every other figure, and
 * those outside of a fisheye's circle. */
enum region_bit {
	REGION_CLOUD = 1, /* the layer takes over 1 % of what is behind it, in any band */
	REGION_SKY = 2,
	REGION_GROUND = 4, /* seen past the layer */
	REGION_ALL = REGION_CLOUD | REGION_SKY | REGION_GROUND
};

/* Layers that the frame must have. */
#define REGIONS_LAYERS (1u << LAYER_TRANSMITTANCE | 1u << LAYER_DISTANCE)

/* frame: a scene-linear picture of the slab with REGIONS_LAYERS; NULL: every pixel that is not left out counts as all three. mask: of the
 * picture's pixels, from the top left. */
void regions_find(const struct scene *scene, const struct frame *frame, uint8_t *mask);

/* One layer of a frame, three channels interleaved; NULL when it has none of it. */
const float *frame_layer(const struct frame *frame, enum layer layer);

#endif
