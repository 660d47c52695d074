/* The reference model on the processor: shaders/passes/reference.glsl compiled as C++ and run on threads, for tests to hold against the
 * shader and against what is known of layers that no request can name. Any thread.
 */
#ifndef STRATUS_TESTS_TWIN_H
#define STRATUS_TESTS_TWIN_H

#include "renderer/scene_block.h"

#include <stdbool.h>
#include <stdint.h>

enum { TWIN_LEVELS_MAX = 14, TWIN_LAYERS = 5, TWIN_OUTPUTS = 3 + TWIN_LAYERS };

/* A texture's levels as rows of width x 4 floats, held by the caller. */
struct twin_texture {
	int width, height, levels;
	bool repeat, nearest;
	const float *level[TWIN_LEVELS_MAX];
};

/* In the order of the pass's samplers. */
enum twin_sampler {
	TWIN_TRANSMITTANCE,
	TWIN_SKY_TOTAL,
	TWIN_SKY_NEAR,
	TWIN_AIR_TO_LAYER,
	TWIN_AIR_TO_END,
	TWIN_GROUND,
	TWIN_PHASE,
	TWIN_TOPS,
	TWIN_BOUNDS,
	TWIN_INVERSE,
	TWIN_CHAINS,
	TWIN_SKY_AT_LAYER,
	TWIN_SKY_AT_GROUND,
	TWIN_SAMPLER_COUNT
};

struct twin {
	struct scene_block block;
	struct twin_texture texture[TWIN_SAMPLER_COUNT];
	bool above;
	uint32_t seed, paths;
	int layer[TWIN_LAYERS];    /* enum layer; -1: none */
	const float *disc_weights; /* three bands a pixel of the block's sun_disc_box; NULL: none is seen */
};

/* Adds samples [first, first + count) of every pixel to the outputs, each width x height x 4 floats: color, its part left to chance and the
 * square of that, then the layers. */
void twin_run(const struct twin *twin, int width, int height, int first, int count, int threads, float *outputs[TWIN_OUTPUTS]);

#endif
