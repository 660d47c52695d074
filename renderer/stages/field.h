/* The field stage: thickness of the cloud layer over one periodic tile.
 *
 * Depends on the cloud's type, seed, time, coverage, tile, resolution and wind. The field is kept before its threshold
 * (shaders/lib/field.glsl); coverage becomes the quantile of it where cloud begins. Beside it stands the thickness after the threshold,
 * as it is and evened out over the block's slab_light; for views from above a finer one with a pyramid of maxima, and the sun on it.
 */
#ifndef STRATUS_RENDERER_STAGES_FIELD_H
#define STRATUS_RENDERER_STAGES_FIELD_H

#include "renderer/stages/field_noise.h"
#include "renderer/stages/height_light.h"
#include "renderer/stages/side_light.h"
#include "renderer/stages/height_puffs.h"
#include "renderer/stages/packed.h"

enum { FIELD_PASS_COUNT = 6 };

struct field_stage {
	struct pass *passes[FIELD_PASS_COUNT];
	struct field_noise noise;
	struct height_light_stage light;
	struct side_light_stage sides;
	struct pass *pack;
	unsigned histogram; /* OpenGL buffer */
};

/* What maps are wanted for. */
enum field_use {
	FIELD_FROM_BELOW = 1,
	FIELD_FROM_ABOVE = 2 /* height and light */
};

/* Of a scene: what its camera sees of the layer, and what a sea below mirrors of it. As bits of enum field_use. */
unsigned field_uses(const struct scene *scene);

struct field_maps {
	const struct texture *coarse, *detail; /* density before the threshold, and its detail */
	const struct texture *thickness;       /* over the tile, m, in the frame of the drifting clouds, 256 texels a side */
	const struct texture *smooth;          /* the same evened out */
	/* Finer thickness with its maxima, the sun on it, and puffs still finer; NULL unless asked for. */
	const struct texture *height;
	const struct height_light *light;
	const struct height_puffs *puffs;
	/* Packed, for views from below; coarse and detail NULL at resolutions where that would be too much memory. */
	const struct texture *coarse_packed, *detail_packed, *thickness_packed;
	/* For views from below: how the sun lights base and sides (renderer/stages/side_light.h). */
	const struct texture *sides;
};

bool field_stage_init(struct field_stage *stage, const struct pass_compiler *compiler);
void field_stage_finish(struct field_stage *stage);

/* Fills in the block's cloud members. Wants slab_slices_get to have run. uses: bits of enum field_use. Maps stay valid for
 * this frame; without clouds they are all NULL. false (and a log line) when out of memory. */
bool field_stage_run(const struct field_stage *stage, struct stage_context *context, const struct scene *scene, unsigned uses,
		     struct field_maps *maps);

#endif
