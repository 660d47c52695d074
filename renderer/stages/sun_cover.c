#include "renderer/stages/sun_cover.h"

#include "renderer/log.h"

#include <stdlib.h>
#include <string.h>

void sun_cover_stage_init(struct sun_cover_stage *stage, const struct pass_compiler *compiler)
{
	*stage = (struct sun_cover_stage){.compiler = *compiler};
}

void sun_cover_stage_finish(struct sun_cover_stage *stage)
{
	stage_destroy_passes(stage->passes, 2);
	*stage = (struct sun_cover_stage){0};
}

static bool compute(struct sun_cover_stage *stage, const struct field_maps *field, struct sun_cover *cover)
{
	const bool packed = field->coarse_packed;
	const struct pass_desc desc = {.file = "shaders/passes/sun_cover.glsl",
				       .defines = packed ? "#define FIELD_PACKED 1\n" : NULL,
				       .outputs = 1,
				       .samplers = {"field_coarse", "field_detail"}};
	struct texture texture;
	if (!stage->passes[packed] && !(stage->passes[packed] = pass_create(&stage->compiler, &desc)))
		return false;
	if (!texture_init(&texture, SUN_COVER_SIDE, SUN_COVER_SIDE, TEXTURE_RGBA32F, TEXTURE_NEAREST))
		return false;
	struct pass_run run = {.targets = (struct texture *[]){&texture},
			       .samplers = {packed ? field->coarse_packed : field->coarse, packed ? field->detail_packed : field->detail}};
	memcpy(run.arguments[0], cover->a, sizeof cover->a);
	memcpy(run.arguments[1], cover->b, sizeof cover->b);
	run.arguments[0][3] = SUN_COVER_SIDE;
	pass_run(stage->passes[packed], &run);
	stage_read_texture(&texture, 0, 4, &cover->share[0][0][0]);
	texture_finish(&texture);
	return true;
}

const struct sun_cover *sun_cover_stage_run(struct sun_cover_stage *stage, struct stage_context *context, const struct scene *scene,
					    const struct field_maps *field, bool below)
{
	struct cache_key key = cache_key_make("sun cover");
	for (int axis = 0; axis < 3; axis++)
		cache_key_add(&key, scene->camera.position_m[axis]);
	stage_key_add_light(&key, scene);
	struct sun_cover *cover = cache_find(context->cache, &key);
	if (cover)
		return cover;
	const float *direction = context->block.sun_direction;
	const double sun[3] = {direction[0], direction[1], direction[2]};
	cover = malloc(sizeof *cover);
	if (cover)
		sun_cover_clear(cover, sun);
	/* Under the horizon it is not looked at. */
	if (!cover || (below && direction[2] > -direction[3] && !compute(stage, field, cover))) {
		log_error("sun's disc: out of memory or no program");
		free(cover);
		return NULL;
	}
	return cache_keep(context->cache, &key, cover, sizeof *cover, free) ? cover : NULL;
}
