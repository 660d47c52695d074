#include "renderer/stages/view_samples.h"

#include "renderer/camera.h"

#include <math.h>
#include <stdio.h>

/* Largest angle between rays, rad, and what one of them covers at most: with these the light of broken clouds is right within a percent
 * (tests/unit/test_renderer_panoramas.c). Pixels that are hardly smaller want two rays a side all the same, lest they show single places.
 */
static const double ray_angle = 0.0062, ray_footprint = 0.002, fine_angle = 0.0035;
/* Pictures are made no finer than of so many rays. */
static const double rays_max = 1 << 22;

void view_samples_init(struct view_samples_stage *stage, const struct pass_compiler *compiler)
{
	*stage = (struct view_samples_stage){.compiler = *compiler};
}

void view_samples_finish(struct view_samples_stage *stage)
{
	stage_destroy_passes(stage->reduce, PROJECTION_COUNT);
}

struct view_samples view_samples_of(const struct scene *scene)
{
	const struct camera_view view = camera_view_of(scene, 0);
	const double angle = camera_pixel_angle(&view), most = floor(sqrt(rays_max / scene->output.width / scene->output.height));
	if (scene->camera.projection == PROJECTION_PERSPECTIVE)
		return (struct view_samples){1, 1};
	const double per_side = fmax(1, fmin(fmax(ceil(angle / ray_angle), angle > fine_angle ? 2 : 1), most));
	return (struct view_samples){(int)per_side, fmin(1, ray_footprint * per_side / angle)};
}

static const struct pass *pass_of(struct view_samples_stage *stage, enum projection projection)
{
	char defines[48];
	snprintf(defines, sizeof defines, "#define VIEW_PROJECTION %d\n", projection);
	if (!stage->reduce[projection])
		stage->reduce[projection] = pass_create(&stage->compiler, &(struct pass_desc){.file = "shaders/passes/view_reduce.glsl",
											      .defines = defines,
											      .outputs = 1,
											      .samplers = {"fine"}});
	return stage->reduce[projection];
}

bool view_samples_reduce(struct view_samples_stage *stage, const struct camera_view *view, int per_side, enum layer layer, uint32_t paths,
			 const struct texture *fine, struct texture *picture)
{
	const struct pass *pass = pass_of(stage, view->projection);
	const bool disc = (layer == LAYER_COLOR || layer == LAYER_SUN_DIRECT) && (paths & 1);
	if (pass)
		pass_run(pass, &(struct pass_run){.targets = &picture,
						  .width = picture->width,
						  .first_row = view->first_row,
						  .height = view->height,
						  .samplers = {fine},
						  .arguments = {{(float)per_side, layer == LAYER_DISTANCE, disc}}});
	return pass;
}
