/* Mean reflectance of the grounds per band (650, 550, 450 nm), for the light that the air gets back from below. The pictures themselves
 * are drawn by shaders/lib/ground.glsl; a test compares both. Any thread. */
#ifndef STRATUS_RENDERER_STAGES_GROUND_H
#define STRATUS_RENDERER_STAGES_GROUND_H

#include "renderer/scene.h"

/* mean: over a tile, 0..1 per band. Returns the largest reflectance that occurs in any band. */
double ground_mean_reflectance(const struct scene_ground *ground, double mean[3]);

#endif
