/* The sun-cover stage: what the layer above the camera leaves of the sun's beam, over the disc.
 *
 * Depends on light and camera position alone.
 */
#ifndef STRATUS_RENDERER_STAGES_SUN_COVER_H
#define STRATUS_RENDERER_STAGES_SUN_COVER_H

#include "renderer/stages/field.h"
#include "renderer/sun_disc.h"

struct sun_cover_stage {
	struct pass_compiler compiler;
	struct pass *passes[2]; /* of a field as it is, and packed; made with the first frame that wants them */
};

void sun_cover_stage_init(struct sun_cover_stage *stage, const struct pass_compiler *compiler);
void sun_cover_stage_finish(struct sun_cover_stage *stage);

/* Wants the block uploaded with the camera's position. below: the camera is under a layer. Waits for the GPU. The cover is the cache's and
 * valid for this frame; NULL and a log line when out of memory or when the program does not compile. */
const struct sun_cover *sun_cover_stage_run(struct sun_cover_stage *stage, struct stage_context *context, const struct scene *scene,
					    const struct field_maps *field, bool below);

#endif
