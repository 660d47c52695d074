#include "renderer/stages/height_view.h"

#include "renderer/log.h"

static const struct pass_desc start_desc = {
	.file = "shaders/passes/height_start.glsl", .defines = "#define HEIGHT_NEAR 0\n", .outputs = 1, .samplers = {"height_table"}};
static const struct pass_desc view_descs[] = {
	{.file = "shaders/passes/height_view.glsl",
	 .defines = "#define HEIGHT_NEAR 0\n",
	 .outputs = 2,
	 .samplers = {"height_table", "height_light", "smooth_table", "height_start"}},
	{.file = "shaders/passes/height_view.glsl",
	 .defines = "#define HEIGHT_NEAR 1\n",
	 .outputs = 2,
	 .samplers = {"height_table", "height_light", "smooth_table", "height_start", "field_detail"}},
};

/* Pixels a side of the blocks, as in shaders/lib/height_march.glsl. */
enum { BLOCK = 8 };
/* Distance within which there are puffs, m, as in shaders/lib/height_detail.glsl. */
static const double near_m = 1500;

bool height_view_init(struct height_view_stage *stage, const struct pass_compiler *compiler)
{
	stage->start = pass_create(compiler, &start_desc);
	return stage->start && stage_create_passes(compiler, view_descs, stage->view, 2);
}

void height_view_finish(struct height_view_stage *stage)
{
	pass_destroy(stage->start);
	stage_destroy_passes(stage->view, 2);
	*stage = (struct height_view_stage){0};
}

bool height_view_run(const struct height_view_stage *stage, const struct scene *scene, const struct field_maps *field,
		     struct height_view *view)
{
	const int width = scene->output.width, height = scene->output.height;
	const bool near = scene->camera.position_m[2] - scene->clouds.base_m - scene->clouds.thickness_m < near_m;
	struct texture start = {0};
	*view = (struct height_view){0};
	const bool ok = texture_init(&start, (width + BLOCK - 1) / BLOCK, (height + BLOCK - 1) / BLOCK, TEXTURE_R32F, TEXTURE_NEAREST) &&
			texture_init(&view->place, width, height, TEXTURE_RGBA32F, TEXTURE_NEAREST) &&
			texture_init(&view->light, width, height, TEXTURE_RGBA32F, TEXTURE_NEAREST);
	if (ok) {
		pass_run(stage->start, &(struct pass_run){.targets = (struct texture *[]){&start}, .samplers = {field->height}});
		pass_run(stage->view[near],
			 &(struct pass_run){.targets = (struct texture *[]){&view->place, &view->light},
					    .samplers = {field->height, field->light, field->smooth, &start, field->detail}});
	} else {
		log_error("view: out of memory");
		height_view_release(view);
	}
	texture_finish(&start);
	return ok;
}

void height_view_release(struct height_view *view)
{
	texture_finish(&view->place);
	texture_finish(&view->light);
}
