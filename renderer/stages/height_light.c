#include "renderer/stages/height_light.h"

#include <math.h>
#include <stdlib.h>

enum { PASS_SHADOW, PASS_RECEIVED, PASS_SOFTEN };

static const struct pass_desc pass_descs[HEIGHT_LIGHT_PASS_COUNT] = {
	[PASS_SHADOW] = {.file = "shaders/passes/height_shadow.glsl", .outputs = 1, .samplers = {"height_table", "shadow_below"}},
	[PASS_RECEIVED] = {.file = "shaders/passes/height_received.glsl", .outputs = 1, .samplers = {"height_table", "shadow_table"}},
	[PASS_SOFTEN] = {.file = "shaders/passes/height_soften.glsl", .outputs = 2, .samplers = {"height_table", "received_table"}},
};

/* LIGHT_SIDE and LOWEST_SUN as in shaders/lib/height_sun.glsl. */
enum { LIGHT_SIDE = 512 };
static const double lowest_sun = 0.035;

/* Distance to the nearest place that can throw a shadow, in texels. */
static const double first_step = 0.75;

/* How far from where it went in often scattered light comes out again. The smoothing length eta = sqrt(H / ((1-g) sigma)) is a root mean
 * square displacement but for a factor of 1.4 (Marshak et al. 1998), and a square that light is evened out over is sqrt(6) times as long as
 * the root mean square distance from its middle. The distances are sharply peaked with a long tail: by tracing light through layers of an
 * optical thickness of 12 to 40 under suns at 35 and 65 degrees (g = 0.85), what was scattered six times and more lies within 0.3, 0.5,
 * 0.9, 1.5 and 2.35 eta at 10, 25, 50, 75 and 90 %. Two squares that give the same within a few percent: sides in eta, and the weight of
 * the short one. Under a sun at 7 degrees the distances are a tenth less. */
static const double short_side = 1.73, long_side = 4.6, short_weight = 0.6;
/* Light that is scattered a few times: side in mean free paths, after delta scaling. Chosen among 1 to 6 by light paths, seen towards suns
 * at 4 to 12 degrees. */
static const double near_side = 5;

bool height_light_init(struct height_light_stage *stage, const struct pass_compiler *compiler)
{
	return stage_create_passes(compiler, pass_descs, stage->passes, HEIGHT_LIGHT_PASS_COUNT);
}

void height_light_finish(struct height_light_stage *stage)
{
	stage_destroy_passes(stage->passes, HEIGHT_LIGHT_PASS_COUNT);
}

static void light_finish(struct height_light *light)
{
	texture_finish(&light->surface);
	texture_finish(&light->near);
}

/* Tables of one computation; `light` is what remains. */
struct tables {
	struct texture shadow[2], received;
	struct height_light light;
};

static void tables_finish(struct tables *tables)
{
	texture_finish(&tables->shadow[0]);
	texture_finish(&tables->shadow[1]);
	texture_finish(&tables->received);
	light_finish(&tables->light);
}

static bool tables_init(struct tables *tables)
{
	*tables = (struct tables){0};
	return texture_init(&tables->shadow[0], LIGHT_SIDE, LIGHT_SIDE, TEXTURE_R32F, TEXTURE_REPEAT) &&
	       texture_init(&tables->shadow[1], LIGHT_SIDE, LIGHT_SIDE, TEXTURE_R32F, TEXTURE_REPEAT) &&
	       texture_init(&tables->received, LIGHT_SIDE, LIGHT_SIDE, TEXTURE_RGBA32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS) &&
	       texture_init(&tables->light.surface, LIGHT_SIDE, LIGHT_SIDE, TEXTURE_RGBA16F, TEXTURE_REPEAT | TEXTURE_MIPMAPS) &&
	       texture_init(&tables->light.near, LIGHT_SIDE, LIGHT_SIDE, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS);
}

/* The shadow of all that stands within the reach of the highest top; returns which of the two tables holds it. */
static int run_shadow(const struct height_light_stage *stage, const struct scene_block *block, const struct texture *height,
		      struct tables *tables)
{
	const double mu = fmin(fmax(block->sun_direction[2], lowest_sun), 0.9999), rise = mu / sqrt(1 - mu * mu);
	const double tile = block->cloud_layer[2], reach = fmin(block->cloud_layer[1] / rise, tile);
	double distance = first_step * tile / LIGHT_SIDE;
	int at = 0;
	for (bool first = true;; first = false, at = !at) {
		struct pass_run run = {.targets = (struct texture *[]){&tables->shadow[at]},
				       .samplers = {height, &tables->shadow[!at]},
				       .arguments = {{(float)(distance / tile), (float)(distance * rise), first}}};
		pass_run(stage->passes[PASS_SHADOW], &run);
		if (!first)
			distance *= 2;
		if (distance >= reach)
			return at;
	}
}

static void compute(const struct height_light_stage *stage, const struct scene_block *block, const struct texture *height,
		    struct tables *tables)
{
	const double smoothing = block->slab_light[2];
	const int shadow = run_shadow(stage, block, height, tables);
	pass_run(stage->passes[PASS_RECEIVED],
		 &(struct pass_run){.targets = (struct texture *[]){&tables->received}, .samplers = {height, &tables->shadow[shadow]}});
	texture_build_mipmaps(&tables->received);
	pass_run(stage->passes[PASS_SOFTEN],
		 &(struct pass_run){.targets = (struct texture *[]){&tables->light.surface, &tables->light.near},
				    .samplers = {height, &tables->received},
				    .arguments = {{(float)(short_side * smoothing), (float)(long_side * smoothing), (float)short_weight,
						   (float)(near_side / block->extinction_scaled[1])}}});
	texture_build_mipmaps(&tables->light.surface);
	texture_build_mipmaps(&tables->light.near);
}

static void light_destroy(void *value)
{
	light_finish(value);
	free(value);
}

const struct height_light *height_light_get(const struct height_light_stage *stage, struct stage_context *context,
					    const struct scene *scene, const struct texture *height)
{
	struct cache_key key = cache_key_make("height light");
	stage_key_add_light(&key, scene);
	struct height_light *light = cache_find(context->cache, &key);
	if (light)
		return light;
	context->reused = false;
	struct tables tables;
	light = calloc(1, sizeof *light);
	if (!tables_init(&tables) || !light) {
		tables_finish(&tables);
		free(light);
		return NULL;
	}
	compute(stage, &context->block, height, &tables);
	*light = tables.light;
	tables.light = (struct height_light){0};
	tables_finish(&tables);
	return cache_keep(context->cache, &key, light, texture_bytes(&light->surface) + texture_bytes(&light->near), light_destroy) ? light
																    : NULL;
}
