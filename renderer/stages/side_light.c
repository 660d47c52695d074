#include "renderer/stages/side_light.h"

#include <stdlib.h>

enum { PASS_COLUMNS, PASS_SPREAD };

static const struct pass_desc pass_descs[SIDE_LIGHT_PASS_COUNT] = {
	[PASS_COLUMNS] = {.file = "shaders/passes/side_columns.glsl", .outputs = 1, .samplers = {"thickness"}},
	[PASS_SPREAD] = {.file = "shaders/passes/side_spread.glsl", .outputs = 1, .samplers = {"columns"}},
};

/* The kernel falls like that of Marshak et al. (1998), sharply peaked with a long tail: two lengths, the short one as a share of the long
 * one, and its weight. */
static const double short_length = 0.3, short_weight = 0.4;

bool side_light_init(struct side_light_stage *stage, const struct pass_compiler *compiler)
{
	return stage_create_passes(compiler, pass_descs, stage->passes, SIDE_LIGHT_PASS_COUNT);
}

void side_light_finish(struct side_light_stage *stage)
{
	stage_destroy_passes(stage->passes, SIDE_LIGHT_PASS_COUNT);
}

static void texture_destroy(void *value)
{
	struct texture *texture = value;
	if (texture)
		texture_finish(texture);
	free(texture);
}

static bool compute(const struct side_light_stage *stage, const struct scene_block *block, const struct texture *thickness,
		    struct texture *light)
{
	const int side = thickness->width;
	const double smoothing = block->slab_light[2];
	struct texture columns;
	if (!texture_init(&columns, side, side, TEXTURE_RGBA32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS))
		return false;
	const bool ok = texture_init(light, side, side, TEXTURE_RGBA32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS);
	if (ok) {
		pass_run(stage->passes[PASS_COLUMNS], &(struct pass_run){.targets = (struct texture *[]){&columns},
									 .samplers = {thickness},
									 .arguments = {{(float)side}}});
		texture_build_mipmaps(&columns);
		pass_run(stage->passes[PASS_SPREAD], &(struct pass_run){.targets = &light,
									.samplers = {&columns},
									.arguments = {{(float)(short_length * smoothing), (float)smoothing,
										       (float)short_weight, (float)side}}});
	}
	if (ok)
		texture_build_mipmaps(light);
	texture_finish(&columns);
	return ok;
}

const struct texture *side_light_get(const struct side_light_stage *stage, struct stage_context *context, const struct scene *scene,
				     const struct texture *thickness)
{
	struct cache_key key = cache_key_make("side light");
	stage_key_add_light(&key, scene);
	struct texture *light = cache_find(context->cache, &key);
	if (light)
		return light;
	context->reused = false;
	light = calloc(1, sizeof *light);
	if (!light || !compute(stage, &context->block, thickness, light)) {
		texture_destroy(light);
		return NULL;
	}
	return cache_keep(context->cache, &key, light, texture_bytes(light), texture_destroy) ? light : NULL;
}
