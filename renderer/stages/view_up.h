/* Pixels that look up at the layer, fast: the color alone, in the solved shading, while the sun lights only the layer's top.
 *
 * What is smooth over the sky comes out of tables (shaders/lib/view_up.glsl): of the first order of scattering over angle and depth, one
 * for each droplet size distribution; of the light of the other orders over direction and depth, one for each elevation of the sun and
 * height of camera and layer; of the air, as the frame has it. They do not depend on where the camera looks.
 */
#ifndef STRATUS_RENDERER_STAGES_VIEW_UP_H
#define STRATUS_RENDERER_STAGES_VIEW_UP_H

#include "renderer/stages/radiosity.h"

enum { VIEW_UP_AIR_TABLES = 3, VIEW_UP_DETAILS = 3 };

/* How far away the layer is in some rows of pixels: anywhere; none is larger than half a texel of the field, nor shows the sun's disc;
 * each, or some, look so low that clouds stand to them (shaders/lib/side_low.glsl). */
enum view_up_reach { VIEW_UP_FAR, VIEW_UP_NEAR, VIEW_UP_LOW, VIEW_UP_SOME_LOW, VIEW_UP_REACHES };

/* What rows of pixels show of the sun's disc (shaders/lib/sun_disc.glsl): nothing, one whose light was spread over pixels beforehand, one
 * that is large. */
enum view_up_disc { VIEW_UP_NO_DISC, VIEW_UP_SMALL_DISC, VIEW_UP_LARGE_DISC, VIEW_UP_DISCS };

struct view_up_stage {
	struct pass_compiler compiler; /* shader_dir must outlive the stage */
	struct pass *air, *first, *light;
	/* By view_up_pass's arguments; all but those that most pictures need are made when wanted. */
	struct pass *look[PROJECTION_COUNT][2][VIEW_UP_REACHES][VIEW_UP_DISCS][VIEW_UP_DETAILS];
	struct texture air_tables[VIEW_UP_AIR_TABLES]; /* of the frame in work */
	struct texture received;                       /* view of radiosity_light.cloud_received */
};

/* What a frame is made of. */
struct view_up_inputs {
	const struct droplets *droplets;
	const struct texture *slab_rows, *slab_slices;
	const struct sky_tables *sky;
	const struct field_maps *field;
	const struct radiosity_light *light;
};

bool view_up_init(struct view_up_stage *stage, const struct pass_compiler *compiler);
void view_up_finish(struct view_up_stage *stage);

/* Makes the tables of a frame, or finds them; the block is uploaded. false (and a log line) when out of memory. */
bool view_up_prepare(struct view_up_stage *stage, struct stage_context *context, const struct scene *scene,
		     const struct view_up_inputs *inputs, struct pass_run *run);

/* The program to run over pixels above the horizon, with the samplers that view_up_prepare left in its run. details: tiles of the field's
 * detail, 1..VIEW_UP_DETAILS. NULL after log lines when it does not compile. */
const struct pass *view_up_pass(struct view_up_stage *stage, enum projection projection, bool packed, enum view_up_reach reach,
				enum view_up_disc disc, int details);

#endif
