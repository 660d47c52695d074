#include "renderer/stages/height_view.h"

#include "renderer/log.h"

#include <stdio.h>
#include <string.h>

/* Pixels a side of the blocks, the smaller ones as in shaders/lib/height_march.glsl. */
enum { BLOCK = 8, SMALL_BLOCK = 2 };
/* Held at a time: 128 MiB. */
enum { PIXELS_MAX = 1 << 22 };

static struct pass *create_pass(const struct pass_compiler *compiler, const char *file, int outputs, enum projection projection, int near)
{
	char defines[96];
	struct pass_desc desc = {
		.file = file,
		.defines = defines,
		.outputs = outputs,
		.samplers = {"height_table", "height_light", "smooth_table", "height_start", "height_near_light", "phase_table"}};
	snprintf(defines, sizeof defines, "#define VIEW_PROJECTION %d\n#define HEIGHT_NEAR %d\n", projection, near);
	if (near)
		memcpy(desc.samplers + 6, (const char *[]){"height_puffs", "height_puff_layers"}, 2 * sizeof(char *));
	return pass_create(compiler, &desc);
}

/* Both programs for a projection; false after log lines. */
static bool has_passes(struct height_view_stage *stage, enum projection projection, int near)
{
	struct pass **start = &stage->start[projection], **view = &stage->view[projection][near];
	if (!*start)
		*start = create_pass(&stage->compiler, "shaders/passes/height_start.glsl", 1, projection, 0);
	if (!*view)
		*view = create_pass(&stage->compiler, "shaders/passes/height_view.glsl", 2, projection, near);
	return *start && *view;
}

bool height_view_init(struct height_view_stage *stage, const struct pass_compiler *compiler)
{
	stage->compiler = *compiler;
	return has_passes(stage, PROJECTION_PERSPECTIVE, 1);
}

void height_view_finish(struct height_view_stage *stage)
{
	for (int i = 0; i < PROJECTION_COUNT; i++) {
		pass_destroy(stage->start[i]);
		stage_destroy_passes(stage->view[i], 3);
	}
	*stage = (struct height_view_stage){0};
}

static int blocks(int pixels, int side)
{
	return (pixels + side - 1) / side;
}

bool height_view_create(const struct scene *scene, struct height_view *seen)
{
	const int width = scene->output.width, rows = PIXELS_MAX / width / BLOCK * BLOCK;
	const int height = scene->output.height < rows ? scene->output.height : rows;
	*seen = (struct height_view){0};
	const bool ok =
		texture_init(&seen->first_start, blocks(width, BLOCK), blocks(height, BLOCK), TEXTURE_R32F, TEXTURE_NEAREST) &&
		texture_init(&seen->start, blocks(width, SMALL_BLOCK), blocks(height, SMALL_BLOCK), TEXTURE_R32F, TEXTURE_NEAREST) &&
		texture_init(&seen->place, width, height, TEXTURE_RGBA32F, TEXTURE_NEAREST) &&
		texture_init(&seen->light, width, height, TEXTURE_RGBA32F, TEXTURE_NEAREST);
	if (!ok)
		log_error("view: out of memory");
	return ok;
}

/* Rows [first, end) of what is held. Blocks of two views at once are made anew for the second, when the first has been drawn. */
static void run_start(const struct pass *pass, const struct field_maps *field, int side, int first_row, int first, int end,
		      const struct texture *begun, struct texture *start)
{
	first = first / side;
	end = blocks(end, side);
	pass_run(pass, &(struct pass_run){.targets = &start,
					  .width = start->width,
					  .first_row = first,
					  .height = end - first,
					  .samplers = {field->height, NULL, NULL, begun ? begun : field->height},
					  .arguments = {{(float)side, begun ? BLOCK : 0, (float)first_row}}});
}

bool height_view_run(struct height_view_stage *stage, const struct scene *scene, const struct camera_view *view,
		     const struct field_maps *field, const struct texture *phase, int first, int end, struct height_view *seen)
{
	const int near = height_puffs_octaves(&scene->clouds);
	if (!has_passes(stage, view->projection, near))
		return false;
	const struct pass *start = stage->start[view->projection];
	first -= seen->first_row;
	end -= seen->first_row;
	run_start(start, field, BLOCK, seen->first_row, first, end, NULL, &seen->first_start);
	run_start(start, field, SMALL_BLOCK, seen->first_row, first, end, &seen->first_start, &seen->start);
	pass_run(stage->view[view->projection][near],
		 &(struct pass_run){.targets = (struct texture *[]){&seen->place, &seen->light},
				    .width = seen->place.width,
				    .first_row = first,
				    .height = end - first,
				    .arguments = {{0, 0, (float)seen->first_row}},
				    .samplers = {field->height, &field->light->surface, field->smooth, &seen->start, &field->light->near,
						 phase, &field->puffs->volume, &field->puffs->layers}});
	return true;
}

void height_view_release(struct height_view *seen)
{
	texture_finish(&seen->light);
	texture_finish(&seen->place);
	texture_finish(&seen->start);
	texture_finish(&seen->first_start);
}
