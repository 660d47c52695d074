/* The sea's surface: its waves for this place and time, its albedo, and the sky that it mirrors, as a picture of the upper hemisphere with
 * its means, made once a frame. Part of the view stage's time.
 */
#ifndef STRATUS_RENDERER_STAGES_SEA_H
#define STRATUS_RENDERER_STAGES_SEA_H

#include "renderer/stages/view.h"

/* Height, m, from which the mirrored sky is seen. */
extern const double sea_eye_m;

struct sea_stage {
	struct pass_compiler compiler;   /* shader_dir must outlive the stage */
	struct pass *passes[2][2][2][2]; /* by clouds, shading, twilight, packed; made with the first picture of a sea */
};

void sea_stage_init(struct sea_stage *stage, const struct pass_compiler *compiler);
void sea_stage_finish(struct sea_stage *stage);

/* Fills in the block's waves; for every ground, since the block is one. Any thread. */
void sea_fill_block(struct scene_block *block, const struct scene *scene);

/* Wind over the water, m/s: that of the clouds, within 2 to 15. Any thread. */
double sea_wind(const struct scene_clouds *clouds);

/* Share of the light that comes back from the sea as the sky above receives it, per band. Of the beam 0.037 / (1.1 mu^1.4 + 0.15) (Taylor
 * et al. 1996, Q. J. R. Meteorol. Soc. 122, 839, a fit of aircraft data that follows Payne 1972), of diffuse light 0.06 (Payne 1972); how
 * much is beam is estimated from the sun's height and the coverage. Any thread. */
void sea_albedo(const struct scene *scene, double albedo[3]);

/* The mirrored sky, over the disc of shaders/lib/sea.glsl; valid for this frame. The block's camera and inputs->sky are to be those of
 * sea_eye_m above the camera's foot. NULL (and a log line) when out of memory or when the program does not compile. */
const struct texture *sea_stage_run(struct sea_stage *stage, struct stage_context *context, const struct scene *scene,
				    const struct view_inputs *inputs);

#endif
