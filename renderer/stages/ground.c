#include "renderer/stages/ground.h"

#include "renderer/log.h"
#include "renderer/scene_map.h"
#include "renderer/stages/sea.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { UNIFORM_SIDE = 4, PICTURE_SIDE = 1024 };

/* What the types differ in beside their picture: contrast of what lies close by, deviation of its slopes, and how much longer than wide its
 * forms are: ripples of sand, sastrugi of snow. */
static const struct {
	bool picture;
	double contrast, slope, stretch;
} types[GROUND_TYPE_COUNT] = {
	[GROUND_GRASS] = {true, 0.30, 0, 1},      [GROUND_COUNTRY] = {true, 0.32, 0, 1}, [GROUND_SOIL] = {true, 0.16, 0.12, 1},
	[GROUND_SAND] = {true, 0.05, 0.10, 1.6},  [GROUND_SEA] = {false, 0, 0, 1},       [GROUND_SEA_ICE] = {true, 0.02, 0.06, 2},
	[GROUND_SNOW] = {true, 0.012, 0.06, 1.6}, [GROUND_BLACK] = {false, 0, 0, 1},     [GROUND_LAMBERT] = {false, 0, 0, 1},
};

struct ground {
	struct texture map;
	double mean[3];
};

static void ground_destroy(void *value)
{
	struct ground *ground = value;
	texture_finish(&ground->map);
	free(ground);
}

void ground_stage_init(struct ground_stage *stage, const struct pass_compiler *compiler)
{
	*stage = (struct ground_stage){.compiler = *compiler};
}

void ground_stage_finish(struct ground_stage *stage)
{
	stage_destroy_passes(stage->paint, GROUND_TYPE_COUNT);
}

static bool paint(struct ground_stage *stage, enum ground_type type, struct texture *texture)
{
	char defines[32];
	const struct pass_desc desc = {.file = "shaders/passes/ground_paint.glsl", .defines = defines, .outputs = 1};
	snprintf(defines, sizeof defines, "#define GROUND_TYPE %d\n", type);
	if (!stage->paint[type] && !(stage->paint[type] = pass_create(&stage->compiler, &desc)))
		return false;
	pass_run(stage->paint[type], &(struct pass_run){.targets = &texture, .arguments = {{(float)texture->width}}});
	texture_build_mipmaps(texture);
	return true;
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

static struct ground *ground_compute(struct ground_stage *stage, const struct scene_ground *scene, int side)
{
	struct ground *ground = calloc(1, sizeof *ground);
	if (!ground)
		return NULL;
	if (!texture_init(&ground->map, side, side, TEXTURE_RGBA16, TEXTURE_REPEAT | TEXTURE_MIPMAPS) ||
	    !(scene->map.map ? upload_map(scene, &ground->map) : paint(stage, scene->type, &ground->map))) {
		ground_destroy(ground);
		return NULL;
	}
	float mean[4];
	stage_read_texture(&ground->map, ground->map.levels - 1, 4, mean);
	for (int band = 0; band < 3; band++)
		ground->mean[band] = mean[band];
	return ground;
}

/* Side of the picture, m: as near to this as the tile has whole shares of that size. Larger ones would have texels larger than what stands
 * in fields. Maps are as large as the tile. */
static const double picture_side_m = 22000;

static double picture_side_of(const struct scene *scene)
{
	const double tile = scene->clouds.tile_m;
	return scene->ground.map.map ? tile : tile / fmax(1, round(tile / picture_side_m));
}

/* Regions as shaders/lib/ground.glsl has them: home in pictures, its middle and how far from it no border comes. */
static const double home_middle = 0.25, home_sure = 0.55;

bool ground_has_regions(const struct scene *scene)
{
	const double side = picture_side_of(scene), *position = scene->camera.position_m, h = position[2],
		     reach = sqrt(h * (2 * 6371000.0 + h));
	const double away = fmax(fabs(position[0] - home_middle * side), fabs(position[1] - home_middle * side));
	return types[scene->ground.type].picture && !scene->ground.map.map && away + reach > home_sure * side;
}

static void fill_block(struct scene_block *block, const struct scene *scene, int side)
{
	const double picture = picture_side_of(scene), tile = scene->clouds.tile_m;
	double sea[3];
	sea_albedo(scene, sea);
	for (int band = 0; band < 3; band++) {
		const double albedo = scene->ground.type == GROUND_LAMBERT ? scene->ground.albedo[band]
				      : scene->ground.type == GROUND_SEA   ? sea[band]
									   : 1;
		block->ground_albedo[band] = (float)(scene->ground.albedo_scale * albedo);
	}
	block->ground_albedo[3] = (float)scene->ground.type;
	block->ground_mean_albedo[3] = (float)picture;
	for (int axis = 0; axis < 2; axis++)
		block->ground_region[axis] = (float)round(floor(scene->camera.position_m[axis] / tile) * tile / picture);
	block->ground_region[2] = ground_has_regions(scene);
	block->ground_patch[0] = (float)side;
	block->ground_patch[1] =
		(float)(scene->ground.type == GROUND_SEA ? scene->ground.albedo_scale : types[scene->ground.type].contrast);
	block->ground_patch[2] = (float)types[scene->ground.type].slope;
	block->ground_patch[3] = (float)types[scene->ground.type].stretch;
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

bool ground_stage_run(struct ground_stage *stage, struct stage_context *context, const struct scene *scene, struct ground_maps *maps)
{
	const int side = side_of(&scene->ground);
	fill_block(&context->block, scene, side);
	const float *albedo = context->block.ground_albedo;
	const double inputs[] = {scene->ground.type, albedo[0], albedo[1], albedo[2], scene->ground.albedo_scale, picture_side_of(scene)};
	struct cache_key key = cache_key_make("ground");
	for (size_t i = 0; i < sizeof inputs / sizeof *inputs; i++)
		cache_key_add(&key, inputs[i]);
	stage_key_add_map(&key, scene->ground.map.map);
	struct ground *ground = cache_find(context->cache, &key);
	if (!ground) {
		context->reused = false;
		stage_upload_block(context);
		ground = ground_compute(stage, &scene->ground, side);
		if (!ground || !cache_keep(context->cache, &key, ground, texture_bytes(&ground->map), ground_destroy)) {
			log_error("ground: cannot be painted");
			return false;
		}
	}
	*maps = (struct ground_maps){.map = &ground->map};
	for (int band = 0; band < 3; band++)
		maps->mean[band] = ground->mean[band];
	return true;
}
