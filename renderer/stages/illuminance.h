/* The illuminance stage: what falls on a horizontal plane at the camera, integrated over the hemisphere above it as the view passes see it,
 * clouds, their gaps and the sun behind them included.
 *
 * Depends on light and camera position alone, never on direction, projection or size of a picture.
 */
#ifndef STRATUS_RENDERER_STAGES_ILLUMINANCE_H
#define STRATUS_RENDERER_STAGES_ILLUMINANCE_H

#include "renderer/stages/view.h"

struct illuminance_stage {
	struct pass_compiler compiler;
	struct pass *passes[SHADING_COUNT][VIEW_SIDES][2]
			   [2]; /* by shading, side, twilight, packed; made with the first frame that wants them */
};

struct illuminance {
	double direct[3];  /* horizontal irradiance by the unscattered beam, W/m2/nm in the bands */
	double diffuse[3]; /* by everything else from above the horizontal */
};

void illuminance_stage_init(struct illuminance_stage *stage, const struct pass_compiler *compiler);
void illuminance_stage_finish(struct illuminance_stage *stage);

/* Runs after all that the view needs. The cameras' pixel angle in the block is replaced while it runs. false and a log line when out of
 * memory or when the program does not compile. */
bool illuminance_stage_run(struct illuminance_stage *stage, struct stage_context *context, const struct scene *scene,
			   const struct view_inputs *inputs, struct illuminance *illuminance);

#endif
