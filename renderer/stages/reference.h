/* The reference model: the picture by unbiased Monte Carlo path tracing, in place of the view stage.
 *
 * Light paths go backwards from the camera through the cloud as a volume, over the ground and back, until the sky ends them, and look for
 * the sun on their way (shaders/lib/light_path_sun.glsl says how). Sky, air before the first thing that a path meets, heights of the tops,
 * droplets and ground are those of the slab's view; light between ground and clouds is followed, not solved. Not followed is the air
 * between what a path meets after the first: light from the ground reaches the clouds as it leaves it, sky and sun are those of the place
 * where a path ends.
 *
 * Nothing of it is remembered: pictures that took this long are kept elsewhere.
 */
#ifndef STRATUS_RENDERER_STAGES_REFERENCE_H
#define STRATUS_RENDERER_STAGES_REFERENCE_H

#include "renderer/optics/path_tables.h"
#include "renderer/stages/view.h"

struct reference_stage {
	struct pass_compiler compiler; /* shader_dir must outlive the stage */
	/* By side, layers, projection, large sun, ground; the second by side. Made with the first picture that wants them. */
	struct pass *paths[VIEW_SIDES][2][PROJECTION_COUNT][2][VIEW_GROUNDS];
	struct pass *tops[VIEW_SIDES];
	struct pass *resolve;
	/* Of the last picture: its layers, and what its paths went by (the samplers of shaders/lib/light_path.glsl). */
	struct texture layers[LAYER_COUNT];
	struct reference_tables {
		struct texture tops, bounds, inverse, chains;
	} tables;
	struct disc_buffer disc;
};

struct reference_inputs {
	const struct view_inputs *view;
	const struct texture *sky_at_layer, *sky_at_ground; /* sky_tables.total from the layer's top and from the ground */
};

struct reference_result {
	int samples;  /* of every pixel at least; some may have more */
	bool stopped; /* cancelled in the middle: the picture is what there was */
};

void reference_stage_init(struct reference_stage *stage, const struct pass_compiler *compiler);
void reference_stage_finish(struct reference_stage *stage);

/* Renders layers[0..count) into textures of the output's size, valid until the next call. Ends with scene->model.samples, when its time is
 * over, or, with scene->model.partial, when cancelled after the first sample of every pixel. cancelled may be NULL; it is asked every 50 ms
 * or so. false when cancelled otherwise, out of memory, or when a program does not compile. */
bool reference_stage_run(struct reference_stage *stage, struct stage_context *context, const struct scene *scene,
			 const struct reference_inputs *inputs, const enum layer *layers, int count, renderer_cancelled *cancelled,
			 void *cancel_context, const struct texture **pictures, struct reference_result *result);

#endif
