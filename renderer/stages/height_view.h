/* What the camera sees of the height field from above, per pixel: where, through how much cloud, and how that place is lit. The view pass
 * shades it (shaders/lib/view.glsl).
 *
 * Depends on the camera, the size of the picture and all of the height field and its light.
 */
#ifndef STRATUS_RENDERER_STAGES_HEIGHT_VIEW_H
#define STRATUS_RENDERER_STAGES_HEIGHT_VIEW_H

#include "renderer/stages/field.h"

struct height_view_stage {
	struct pass *start, *view[2]; /* from afar, and near */
};

/* What shaders/passes/height_view.glsl stores. */
struct height_view {
	struct texture place, light;
};

bool height_view_init(struct height_view_stage *stage, const struct pass_compiler *compiler);
void height_view_finish(struct height_view_stage *stage);

/* Renders `view` at the output's size; the caller hands it to height_view_release. Wants the whole block uploaded. false (and a log line)
 * when out of memory. */
bool height_view_run(const struct height_view_stage *stage, const struct scene *scene, const struct field_maps *field,
		     struct height_view *view);
void height_view_release(struct height_view *view);

#endif
