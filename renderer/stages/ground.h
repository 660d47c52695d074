/* The ground: its reflectance as a picture over the tile, painted once. Part of the sky stage's time, since the air is lit from below by
 * the picture's mean.
 */
#ifndef STRATUS_RENDERER_STAGES_GROUND_H
#define STRATUS_RENDERER_STAGES_GROUND_H

#include "renderer/stages/stage.h"

struct ground_stage {
	struct pass_compiler compiler;         /* shader_dir must outlive the stage */
	struct pass *paint[GROUND_TYPE_COUNT]; /* made with the first picture of a type */
};

struct ground_maps {
	const struct texture *map; /* reflectance per band (650, 550, 450 nm), 0..1 */
	double mean[3];            /* of the map */
};

/* Does the camera see ground beyond home (shaders/lib/ground.glsl)? Of what is uniform, and of maps, nothing is rearranged there. */
bool ground_has_regions(const struct scene *scene);

void ground_stage_init(struct ground_stage *stage, const struct pass_compiler *compiler);
void ground_stage_finish(struct ground_stage *stage);

/* Fills in the block's ground members. Maps stay valid for this frame. false (and a log line) when out of memory or when a program does not
 * compile. */
bool ground_stage_run(struct ground_stage *stage, struct stage_context *context, const struct scene *scene, struct ground_maps *maps);

#endif
