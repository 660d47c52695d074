/* The develop stage (shaders/passes/develop.glsl) on the processor, for pictures that are in memory already: the same exposure, tone and
 * sRGB encoding, rounded to 8 bits instead of dithered. Any thread.
 */
#ifndef STRATUS_RENDERER_IMAGE_DEVELOP_H
#define STRATUS_RENDERER_IMAGE_DEVELOP_H

#include "renderer/scene.h"

#include <stddef.h>

/* pixels: scene-linear Rec. 709, three channels interleaved; codes: likewise. */
void develop_picture(const float *pixels, size_t count, double exposure_ev, enum tone tone, unsigned char *codes);

#endif
