#include "renderer/stages/ground.h"

#include "renderer/log.h"
#include "renderer/scene_map.h"

#include <math.h>
#include <stdlib.h>

enum { PASS_PAINT, PASS_RELIEF };

static const struct pass_desc pass_descs[GROUND_PASS_COUNT] = {
	[PASS_PAINT] = {.file = "shaders/passes/ground_paint.glsl", .outputs = 1},
	[PASS_RELIEF] = {.file = "shaders/passes/ground_relief.glsl", .outputs = 1},
};

/* RELIEF_SIDE as in shaders/lib/ground.glsl. */
enum { RELIEF_SIDE = 256, UNIFORM_SIDE = 4, PICTURE_SIDE = 1024 };

/* What the types differ in beside their picture. relief: contrast of what lies
 * close by. */
static const struct {
	bool picture;
	double relief;
} types[GROUND_TYPE_COUNT] = {
	[GROUND_COUNTRY] = {true, 0.22}, [GROUND_SEA] = {false, 0.10},  [GROUND_SEA_ICE] = {true, 0.03},
	[GROUND_SNOW] = {false, 0.02},   [GROUND_BLACK] = {false, 0.0}, [GROUND_LAMBERT] = {false, 0.0},
};

struct ground {
	struct texture map, relief;
	double mean[3];
};

static void ground_destroy(void *value)
{
	struct ground *ground = value;
	texture_finish(&ground->relief);
	texture_finish(&ground->map);
	free(ground);
}

bool ground_stage_init(struct ground_stage *stage, const struct pass_compiler *compiler)
{
	return stage_create_passes(compiler, pass_descs, stage->passes, GROUND_PASS_COUNT);
}

void ground_stage_finish(struct ground_stage *stage)
{
	stage_destroy_passes(stage->passes, GROUND_PASS_COUNT);
}

static void paint(const struct pass *pass, struct texture *texture)
{
	pass_run(pass, &(struct pass_run){.targets = &texture, .arguments = {{(float)texture->width}}});
	texture_build_mipmaps(texture);
}

/* A map's reflectance, scaled. */
static bool upload_map(const struct scene_ground *ground, struct texture *texture)
{
	const size_t count = (size_t)texture->width * (size_t)texture->width;
	float *texels = scene_map_texels(ground->map.map, texture->width), *padded = malloc(4 * count * sizeof *padded);
	for (size_t i = 0; texels && padded && i < count; i++) {
		for (size_t band = 0; band < 3; band++)
			padded[4 * i + band] = (float)ground->albedo_scale * texels[3 * i + band];
		padded[4 * i + 3] = 1;
	}
	const bool ok = texels && padded;
	if (ok)
		texture_upload(texture, padded);
	free(padded);
	free(texels);
	if (ok)
		texture_build_mipmaps(texture);
	return ok;
}

static struct ground *ground_compute(const struct ground_stage *stage, const struct scene_ground *scene, int side)
{
	struct ground *ground = calloc(1, sizeof *ground);
	if (!ground)
		return NULL;
	if (!texture_init(&ground->map, side, side, TEXTURE_RGBA16, TEXTURE_REPEAT | TEXTURE_MIPMAPS) ||
	    !texture_init(&ground->relief, RELIEF_SIDE, RELIEF_SIDE, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS)) {
		ground_destroy(ground);
		return NULL;
	}
	if (!scene->map.map) {
		paint(stage->passes[PASS_PAINT], &ground->map);
	} else if (!upload_map(scene, &ground->map)) {
		ground_destroy(ground);
		return NULL;
	}
	paint(stage->passes[PASS_RELIEF], &ground->relief);
	float mean[4];
	stage_read_texture(&ground->map, ground->map.levels - 1, 4, mean);
	for (int band = 0; band < 3; band++)
		ground->mean[band] = mean[band];
	return ground;
}

static void fill_block(struct scene_block *block, const struct scene *scene, int side)
{
	for (int band = 0; band < 3; band++)
		block->ground_albedo[band] =
			(float)(scene->ground.albedo_scale * (scene->ground.type == GROUND_LAMBERT ? scene->ground.albedo[band] : 1));
	block->ground_albedo[3] = (float)scene->ground.type;
	block->ground_mean_albedo[3] = (float)scene->clouds.tile_m;
	block->ground_patch[0] = (float)side;
	block->ground_patch[1] = (float)types[scene->ground.type].relief;
}

/* Texels a side of the picture. */
static int side_of(const struct scene_ground *ground)
{
	const struct scene_map *map = ground->map.map;
	int side = UNIFORM_SIDE;
	if (!map)
		return types[ground->type].picture ? PICTURE_SIDE : UNIFORM_SIDE;
	while (side < SCENE_MAP_GROUND_SIDE && (side < map->width || side < map->height))
		side *= 2;
	return side;
}

bool ground_stage_run(const struct ground_stage *stage, struct stage_context *context, const struct scene *scene, struct ground_maps *maps)
{
	const int side = side_of(&scene->ground);
	fill_block(&context->block, scene, side);
	const double inputs[] = {scene->ground.type,      scene->ground.albedo_scale, scene->ground.albedo[0],
				 scene->ground.albedo[1], scene->ground.albedo[2],    scene->clouds.tile_m};
	struct cache_key key = cache_key_make("ground");
	for (size_t i = 0; i < sizeof inputs / sizeof *inputs; i++)
		cache_key_add(&key, inputs[i]);
	stage_key_add_map(&key, scene->ground.map.map);
	struct ground *ground = cache_find(context->cache, &key);
	if (!ground) {
		context->reused = false;
		stage_upload_block(context);
		ground = ground_compute(stage, &scene->ground, side);
		if (!ground || !cache_keep(context->cache, &key, ground, texture_bytes(&ground->map) + texture_bytes(&ground->relief),
					   ground_destroy)) {
			log_error("ground: out of memory");
			return false;
		}
	}
	*maps = (struct ground_maps){.map = &ground->map, .relief = &ground->relief};
	for (int band = 0; band < 3; band++)
		maps->mean[band] = ground->mean[band];
	return true;
}
