/* What the camera sees of the height field from above, per pixel: where, through how much cloud, and how that place is lit. The view pass
 * shades it (shaders/lib/view.glsl).
 *
 * Depends on the camera, the size of the picture and all of the height field and its light.
 */
#ifndef STRATUS_RENDERER_STAGES_HEIGHT_VIEW_H
#define STRATUS_RENDERER_STAGES_HEIGHT_VIEW_H

#include "renderer/camera.h"
#include "renderer/stages/field.h"

struct height_view_stage {
	struct pass_compiler compiler;
	/* By projection; the second with puffs, without and with smaller ones. Those of panoramas are made with the first one. */
	struct pass *start[PROJECTION_COUNT], *view[PROJECTION_COUNT][3];
};

/* What shaders/passes/height_view.glsl stores. */
struct height_view {
	struct texture place, light;
	struct texture first_start, start; /* of the march, by blocks of pixels: large ones first */
	int first_row;                     /* of the picture, that their first rows hold */
};

bool height_view_init(struct height_view_stage *stage, const struct pass_compiler *compiler);
void height_view_finish(struct height_view_stage *stage);

/* Textures as wide as the output and as high as it or, of a large one, as a part of it; the caller hands them to height_view_release, also
 * after a failure. false (and a log line) when out of memory. */
bool height_view_create(const struct scene *scene, struct height_view *seen);

/* Renders rows [first, end) of one view of the picture, which must be among those that it holds from first_row on. Wants the whole block
 * uploaded, with that view's camera. false after log lines when a program does not compile. */
bool height_view_run(struct height_view_stage *stage, const struct scene *scene, const struct camera_view *view,
		     const struct field_maps *field, const struct texture *phase, int first, int end, struct height_view *seen);
void height_view_release(struct height_view *seen);

#endif
