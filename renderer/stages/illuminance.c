#include "renderer/stages/illuminance.h"

#include "renderer/log.h"

#include <math.h>
#include <stdlib.h>

/* Rays: enough that a broken sky comes out within half a percent. */
enum { COLUMNS = 128, ROWS_EVEN = 144, ROWS_NEAR = 48, ROWS = ROWS_EVEN + ROWS_NEAR };
/* Footprint of a ray, radians: small, since a mean over thickness is not a mean over light. */
static const float ray_angle = 0.002f;

void illuminance_stage_init(struct illuminance_stage *stage, const struct pass_compiler *compiler)
{
	*stage = (struct illuminance_stage){.compiler = *compiler};
}

void illuminance_stage_finish(struct illuminance_stage *stage)
{
	struct pass **passes = &stage->passes[0][0][0][0];
	for (size_t i = 0; i < sizeof stage->passes / sizeof *passes; i++)
		pass_destroy(passes[i]);
	*stage = (struct illuminance_stage){0};
}

static const struct pass *pass_of(struct illuminance_stage *stage, const struct view_variant *variant)
{
	struct pass **pass = &stage->passes[variant->shading][variant->side][variant->twilight][variant->packed];
	if (!*pass)
		*pass = view_create_pass(&stage->compiler, "shaders/passes/illuminance.glsl", 1, variant);
	return *pass;
}

static void add_rows(float (*texels)[4], int count, double sum[3])
{
	for (int band = 0; band < 3; band++) {
		sum[band] = 0;
		for (int i = 0; i < count; i++)
			sum[band] += texels[i][band];
	}
}

static void add_beam(const struct scene_block *block, const struct sun_cover *cover, double direct[3])
{
	double passed[3] = {1, 1, 1};
	if (cover)
		sun_cover_mean(cover, passed);
	for (int band = 0; band < 3; band++)
		direct[band] = block->sun_at_camera[band] * passed[band] * fmax(block->sun_direction[2], 0);
}

static bool compute(const struct pass *pass, struct stage_context *context, const struct view_variant *variant,
		    const struct view_inputs *inputs, struct illuminance *illuminance)
{
	struct texture rays;
	float(*texels)[4] = malloc(sizeof(float[ROWS][COLUMNS][4]));
	if (!texels || !texture_init(&rays, COLUMNS, ROWS, TEXTURE_RGBA32F, TEXTURE_NEAREST)) {
		free(texels);
		return false;
	}
	struct pass_run run = {.targets = (struct texture *[]){&rays}, .arguments = {{COLUMNS, ROWS_EVEN, ROWS_NEAR}}};
	view_bind_inputs(&run, variant->side, inputs);
	const float angle = context->block.camera_position[3];
	context->block.camera_position[3] = ray_angle;
	stage_upload_block(context);
	pass_run(pass, &run);
	context->block.camera_position[3] = angle;
	stage_upload_block(context);
	stage_read_texture(&rays, 0, 4, &texels[0][0]);
	texture_finish(&rays);
	add_rows(texels, COLUMNS * ROWS, illuminance->diffuse);
	add_beam(&context->block, inputs->sun_cover, illuminance->direct);
	free(texels);
	return true;
}

static struct cache_key make_key(const struct scene *scene)
{
	struct cache_key key = cache_key_make("illuminance");
	for (int axis = 0; axis < 3; axis++)
		cache_key_add(&key, scene->camera.position_m[axis]);
	stage_key_add_light(&key, scene);
	return key;
}

bool illuminance_stage_run(struct illuminance_stage *stage, struct stage_context *context, const struct scene *scene,
			   const struct view_inputs *inputs, struct illuminance *illuminance)
{
	const struct cache_key key = make_key(scene);
	const struct illuminance *known = cache_find(context->cache, &key);
	if (known) {
		*illuminance = *known;
		return true;
	}
	struct view_variant variant = view_variant_of(context, scene, inputs, false);
	variant.ground = VIEW_BARE; /* none is looked at */
	const struct pass *pass = pass_of(stage, &variant);
	struct illuminance *kept = pass ? malloc(sizeof *kept) : NULL;
	if (!kept || !compute(pass, context, &variant, inputs, illuminance)) {
		log_error("illuminance: out of memory or no program");
		free(kept);
		return false;
	}
	*kept = *illuminance;
	return cache_keep(context->cache, &key, kept, sizeof *kept, free);
}
