#include "renderer/stages/field.h"

#include "renderer/log.h"
#include "renderer/scene_map.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdlib.h>

enum { PASS_HISTOGRAM, PASS_HEIGHT, PASS_LEVELS, PASS_SMOOTH, PASS_OPEN, PASS_ROUND };

static const struct pass_desc pass_descs[FIELD_PASS_COUNT] = {
	[PASS_HISTOGRAM] = {.file = "shaders/passes/field_histogram.glsl", .outputs = 0, .samplers = {"field_coarse", "field_detail"}},
	[PASS_HEIGHT] = {.file = "shaders/passes/height_base.glsl", .outputs = 1, .samplers = {"field_coarse", "field_detail"}},
	[PASS_LEVELS] = {.file = "shaders/passes/height_levels.glsl", .outputs = 1, .samplers = {"height_below"}},
	[PASS_SMOOTH] = {.file = "shaders/passes/height_smooth.glsl", .outputs = 1, .samplers = {"thickness"}},
	[PASS_OPEN] = {.file = "shaders/passes/height_open.glsl", .outputs = 1, .samplers = {"heights"}},
	[PASS_ROUND] = {.file = "shaders/passes/height_round.glsl", .outputs = 1, .samplers = {"heights", "rounded"}},
};

/* SMOOTH_SIDE as in shaders/lib/height.glsl. */
enum { SMOOTH_SIDE = 256, HISTOGRAM_SIDE = 256, HISTOGRAM_BINS = 4096 };

/* Densities are sums of cells and noise with weights below 1: nothing lies outside. */
static const double density_lowest = -4, density_highest = 6;

struct coarse_field {
	struct texture coarse, detail;
	unsigned *histogram; /* [HISTOGRAM_BINS] */
};

static void coarse_field_destroy(void *value)
{
	struct coarse_field *field = value;
	if (!field)
		return;
	free(field->histogram);
	texture_finish(&field->detail);
	texture_finish(&field->coarse);
	free(field);
}

static void texture_destroy(void *value)
{
	struct texture *texture = value;
	if (texture)
		texture_finish(texture);
	free(texture);
}

bool field_stage_init(struct field_stage *stage, const struct pass_compiler *compiler)
{
	if (!stage_create_passes(compiler, pass_descs, stage->passes, FIELD_PASS_COUNT) || !field_noise_init(&stage->noise, compiler) ||
	    !height_light_init(&stage->light, compiler) || !side_light_init(&stage->sides, compiler))
		return false;
	stage->pack = packed_pass_create(compiler);
	if (!stage->pack) {
		stage_destroy_passes(stage->passes, FIELD_PASS_COUNT);
		return false;
	}
	glCreateBuffers(1, &stage->histogram);
	glNamedBufferStorage(stage->histogram, HISTOGRAM_BINS * sizeof(unsigned), NULL, 0);
	return true;
}

void field_stage_finish(struct field_stage *stage)
{
	if (stage->histogram)
		glDeleteBuffers(1, &stage->histogram);
	stage->histogram = 0;
	pass_destroy(stage->pack);
	stage->pack = NULL;
	height_light_finish(&stage->light);
	side_light_finish(&stage->sides);
	field_noise_finish(&stage->noise);
	stage_destroy_passes(stage->passes, FIELD_PASS_COUNT);
}

static void fill_block(struct scene_block *block, const struct scene_clouds *clouds)
{
	block->cloud_layer[0] = (float)clouds->base_m;
	block->cloud_layer[1] = (float)clouds->thickness_m;
	block->cloud_layer[2] = (float)clouds->tile_m;
	block->cloud_layer[3] = clouds->type != CLOUD_NONE && clouds->thickness_m > 0 ? 1.0f : 0.0f;
	block->cloud_threshold[3] = (float)clouds->resolution;
	field_noise_fill_block(block, clouds);
	height_puffs_fill_block(block, clouds);
	if (clouds->map.map) /* nothing is added to what a map says */
		block->cloud_field[1] = block->cloud_field[3] = block->cloud_detail[3] = 0;
}

static void count_densities(const struct field_stage *stage, const struct coarse_field *field)
{
	const unsigned zero = 0;
	glClearNamedBufferData(stage->histogram, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
	glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, stage->histogram);
	pass_run(stage->passes[PASS_HISTOGRAM],
		 &(struct pass_run){.width = HISTOGRAM_SIDE,
				    .height = HISTOGRAM_SIDE,
				    .samplers = {&field->coarse, &field->detail},
				    .arguments = {{(float)density_lowest, (float)density_highest, HISTOGRAM_BINS, HISTOGRAM_SIDE}}});
	glGetNamedBufferSubData(stage->histogram, 0, HISTOGRAM_BINS * sizeof(unsigned), field->histogram);
}

static struct coarse_field *coarse_field_compute(const struct field_stage *stage, struct stage_context *context,
						 const struct scene_clouds *clouds)
{
	struct coarse_field *field = calloc(1, sizeof *field);
	if (!field)
		return NULL;
	const int resolution = clouds->resolution;
	field->histogram = calloc(HISTOGRAM_BINS, sizeof *field->histogram);
	if (!field->histogram || !texture_init(&field->coarse, resolution, resolution, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS) ||
	    !texture_init(&field->detail, FIELD_DETAIL_SIDE, FIELD_DETAIL_SIDE, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS) ||
	    !field_noise_run(&stage->noise, context, clouds, &field->coarse, &field->detail)) {
		coarse_field_destroy(field);
		return NULL;
	}
	texture_build_mipmaps(&field->coarse);
	texture_build_mipmaps(&field->detail);
	count_densities(stage, field);
	return field;
}

/* The field of a map: what the map says is thickness already, so there is neither detail nor anything to count. */
static struct coarse_field *coarse_field_of_map(const struct scene_map *map, int resolution)
{
	struct coarse_field *field = calloc(1, sizeof *field);
	float *texels = scene_map_texels(map, resolution), none = 0;
	if (!field || !texels || !texture_init(&field->coarse, resolution, resolution, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS) ||
	    !texture_init(&field->detail, 1, 1, TEXTURE_R32F, TEXTURE_REPEAT)) {
		coarse_field_destroy(field);
		free(texels);
		return NULL;
	}
	texture_upload(&field->coarse, texels);
	texture_upload(&field->detail, &none);
	texture_build_mipmaps(&field->coarse);
	free(texels);
	return field;
}

static void add_field_inputs(struct cache_key *key, const struct scene_clouds *clouds)
{
	stage_key_add_map(key, clouds->map.map);
	if (clouds->map.map) { /* which drifts as it is */
		cache_key_add(key, clouds->tile_m);
		cache_key_add(key, clouds->resolution);
		return;
	}
	const double inputs[] = {clouds->type,       clouds->seed,        clouds->time_s,      clouds->tile_m,
				 clouds->resolution, clouds->wind_mps[0], clouds->wind_mps[1], clouds->coverage};
	for (size_t i = 0; i < sizeof inputs / sizeof *inputs; i++)
		cache_key_add(key, inputs[i]);
}

static const struct coarse_field *coarse_field_get(const struct field_stage *stage, struct stage_context *context,
						   const struct scene *scene)
{
	struct cache_key key = cache_key_make("field");
	add_field_inputs(&key, &scene->clouds);
	struct coarse_field *field = cache_find(context->cache, &key);
	if (field)
		return field;
	context->reused = false;
	const struct scene_map *map = scene->clouds.map.map;
	field = map ? coarse_field_of_map(map, scene->clouds.resolution) : coarse_field_compute(stage, context, &scene->clouds);
	if (!field ||
	    !cache_keep(context->cache, &key, field, texture_bytes(&field->coarse) + texture_bytes(&field->detail), coarse_field_destroy))
		return NULL;
	return field;
}

/* Density below which a share of all places lies, by linear interpolation inside a bin. */
static double quantile(const unsigned *histogram, double share)
{
	double total = 0, below = 0;
	for (int i = 0; i < HISTOGRAM_BINS; i++)
		total += histogram[i];
	const double bin = (density_highest - density_lowest) / (HISTOGRAM_BINS - 2);
	for (int i = 0; i < HISTOGRAM_BINS; i++) {
		if (histogram[i] > 0 && below + histogram[i] >= share * total)
			return density_lowest + bin * (i - 0.5 + (share * total - below) / histogram[i]);
		below += histogram[i];
	}
	return density_highest;
}

/* Inverse of the profile: the share of the range of densities at which the thickness is this share of its maximum. */
static double density_share(const struct field_noise_profile *profile, double thickness)
{
	double low = 0, high = 1;
	for (int i = 0; i < 40; i++) {
		const double middle = 0.5 * (low + high);
		const double at = (1 - pow(1 - middle, profile->roundness)) * middle * (1 + profile->skirt) / (middle + profile->skirt);
		*(at < thickness ? &low : &high) = middle;
	}
	return high;
}

/* The threshold, from the densities as they are; under an overcast it sinks below them all, so that no hole is left. */
static void fill_threshold(struct scene_block *block, const struct scene_clouds *clouds, const unsigned *histogram)
{
	if (clouds->map.map) { /* roundness 0: thickness already */
		block->cloud_threshold[0] = block->cloud_threshold[2] = 0;
		block->cloud_threshold[1] = 1;
		return;
	}
	const struct field_noise_profile profile = field_noise_profile_of(clouds->type);
	const double lowest = quantile(histogram, 0.0005), highest = quantile(histogram, 0.9999);
	double threshold = quantile(histogram, 1 - clouds->coverage);
	const double near_overcast = fmin(1, fmax(0, (clouds->coverage - 0.95) / 0.05));
	threshold -= profile.overcast_lift * (highest - lowest) * near_overcast * near_overcast;
	/* What hardly any light notices, an optical thickness of 0.09 of the default droplets, is no cover. */
	const double edge = density_share(&profile, fmin(0.06, fmax(0.003, 2.4 / clouds->thickness_m)));
	threshold = (threshold - edge * highest) / (1 - edge);
	if (clouds->coverage <= 0)
		threshold = density_highest;
	block->cloud_threshold[0] = (float)threshold;
	block->cloud_threshold[1] = (float)(1 / fmax(highest - threshold, 1e-3));
	block->cloud_threshold[2] = (float)profile.roundness;
}

/* The thickness over the tile, `side` texels a side, with its means. */
static bool height_compute(const struct field_stage *stage, const struct coarse_field *coarse, int side, struct texture *height)
{
	if (!texture_init(height, side, side, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS))
		return false;
	pass_run(stage->passes[PASS_HEIGHT], &(struct pass_run){.targets = (struct texture *[]){height},
								.samplers = {&coarse->coarse, &coarse->detail},
								.arguments = {{(float)side}}});
	texture_build_mipmaps(height);
	return true;
}

/* Level 0 from the heights, each further level from the one below it, read through a view of it alone: levels that are being written must
 * not be within a sampler's reach. */
static void build_levels(const struct field_stage *stage, const struct texture *heights, struct texture *field)
{
	for (int level = 0; level < field->levels; level++) {
		struct texture below = level == 0 ? *heights : texture_level(field, level - 1);
		const int size = level == 0 ? heights->width : heights->width >> (level - 1);
		pass_run(stage->passes[PASS_LEVELS], &(struct pass_run){.targets = (struct texture *[]){field},
									.level = level,
									.samplers = {&below},
									.arguments = {{(float)size, level == 0}}});
		if (level > 0)
			texture_finish(&below);
	}
}

/* Radius of curvature of the sharpest tops, over the thickness: the cells of a field are as wide as they are, however thick it is, and
 * stretched over a thick one they would be spires. */
static const double sharpest_top = 0.12;
/* Thinner layers have no tops to speak of, m. */
static const double flat_thickness = 250;

static bool round_tops(const struct field_stage *stage, double thickness, double tile, struct texture *heights)
{
	const double radius = sharpest_top * thickness;
	struct texture lowest = {0}, highest = {0}, rounded = {0};
	const int whole = heights->width;
	int side = whole / 2;
	while (side > 32 && tile / side < 0.6 * radius)
		side /= 2;
	const double texel = tile / side, fall = texel * texel / (2 * radius);
	const bool ok = texture_init(&lowest, side, side, TEXTURE_R32F, TEXTURE_REPEAT) &&
			texture_init(&highest, side, side, TEXTURE_R32F, TEXTURE_REPEAT) &&
			texture_init(&rounded, whole, whole, TEXTURE_R32F, TEXTURE_REPEAT);
	if (ok) {
		const float level = log2f((float)whole / (float)side);
		pass_run(stage->passes[PASS_OPEN], &(struct pass_run){.targets = (struct texture *[]){&lowest},
								      .samplers = {heights},
								      .arguments = {{(float)side, (float)fall, 1, level}}});
		pass_run(stage->passes[PASS_OPEN], &(struct pass_run){.targets = (struct texture *[]){&highest},
								      .samplers = {&lowest},
								      .arguments = {{(float)side, (float)fall, -1, 0}}});
		pass_run(stage->passes[PASS_ROUND],
			 &(struct pass_run){.targets = (struct texture *[]){&rounded},
					    .samplers = {heights, &highest},
					    .arguments = {{(float)whole, (float)side, (float)(0.08 * thickness)}}});
		texture_finish(heights);
		*heights = rounded;
		rounded = (struct texture){0};
	}
	texture_finish(&rounded);
	texture_finish(&highest);
	texture_finish(&lowest);
	return ok;
}

static struct texture *height_field_compute(const struct field_stage *stage, const struct scene_clouds *clouds,
					    const struct coarse_field *coarse)
{
	const int side = height_puffs_field_side(clouds);
	struct texture heights = {0}, *field = calloc(1, sizeof *field);
	/* Where texels are larger than spires, there are none. */
	const bool tops =
		!clouds->map.map && clouds->thickness_m > flat_thickness && sharpest_top * clouds->thickness_m > 2 * clouds->tile_m / side;
	if (!field || !height_compute(stage, coarse, side, &heights) ||
	    (tops && !round_tops(stage, clouds->thickness_m, clouds->tile_m, &heights)) ||
	    !texture_init(field, side, side, TEXTURE_RG16, TEXTURE_REPEAT | TEXTURE_MIPMAPS)) {
		texture_finish(&heights);
		texture_destroy(field);
		return NULL;
	}
	build_levels(stage, &heights, field);
	texture_finish(&heights);
	return field;
}

static struct cache_key thickness_key(const char *name, const struct scene_clouds *clouds)
{
	struct cache_key key = cache_key_make(name);
	add_field_inputs(&key, clouds);
	cache_key_add(&key, clouds->thickness_m);
	return key;
}

static const struct texture *height_field_get(const struct field_stage *stage, struct stage_context *context, const struct scene *scene,
					      const struct coarse_field *coarse)
{
	const struct cache_key key = thickness_key("height", &scene->clouds);
	struct texture *field = cache_find(context->cache, &key);
	if (field)
		return field;
	context->reused = false;
	field = height_field_compute(stage, &scene->clouds, coarse);
	if (!field || !cache_keep(context->cache, &key, field, texture_bytes(field), texture_destroy))
		return NULL;
	return field;
}

struct thickness_field {
	struct texture thickness, smooth;
};

static void thickness_field_destroy(void *value)
{
	struct thickness_field *field = value;
	if (!field)
		return;
	texture_finish(&field->smooth);
	texture_finish(&field->thickness);
	free(field);
}

static struct thickness_field *thickness_field_compute(const struct field_stage *stage, const struct coarse_field *coarse, double length_m)
{
	struct thickness_field *field = calloc(1, sizeof *field);
	if (!field || !height_compute(stage, coarse, SMOOTH_SIDE, &field->thickness) ||
	    !texture_init(&field->smooth, SMOOTH_SIDE, SMOOTH_SIDE, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS)) {
		thickness_field_destroy(field);
		return NULL;
	}
	pass_run(stage->passes[PASS_SMOOTH], &(struct pass_run){.targets = (struct texture *[]){&field->smooth},
								.samplers = {&field->thickness},
								.arguments = {{SMOOTH_SIDE, (float)length_m}}});
	texture_build_mipmaps(&field->smooth);
	return field;
}

static const struct thickness_field *thickness_field_get(const struct field_stage *stage, struct stage_context *context,
							 const struct scene *scene, const struct coarse_field *coarse)
{
	const double length = context->block.slab_light[2];
	struct cache_key key = thickness_key("smooth", &scene->clouds);
	cache_key_add(&key, length);
	struct thickness_field *field = cache_find(context->cache, &key);
	if (field)
		return field;
	context->reused = false;
	field = thickness_field_compute(stage, coarse, length);
	if (!field || !cache_keep(context->cache, &key, field, texture_bytes(&field->thickness) + texture_bytes(&field->smooth),
				  thickness_field_destroy))
		return NULL;
	return field;
}

static bool thickness_get(const struct field_stage *stage, struct stage_context *context, const struct scene *scene,
			  const struct coarse_field *coarse, unsigned uses, struct field_maps *maps)
{
	const struct thickness_field *thickness = thickness_field_get(stage, context, scene, coarse);
	if (!thickness)
		return false;
	maps->thickness = &thickness->thickness;
	maps->smooth = &thickness->smooth;
	if (stage_is_stopped(context))
		return false;
	if (uses & FIELD_FROM_BELOW && !(maps->sides = side_light_get(&stage->sides, context, scene, maps->thickness)))
		return false;
	if (!(uses & FIELD_FROM_ABOVE))
		return true;
	if (stage_is_stopped(context))
		return false;
	maps->height = height_field_get(stage, context, scene, coarse);
	maps->light = maps->height && !stage_is_stopped(context) ? height_light_get(&stage->light, context, scene, maps->height) : NULL;
	maps->puffs = maps->light && !stage_is_stopped(context) ? height_puffs_get(context) : NULL;
	return maps->puffs;
}

/* Packed pictures take six times the memory. */
static bool packed_maps_get(const struct field_stage *stage, struct stage_context *context, const struct scene_clouds *clouds,
			    struct field_maps *maps)
{
	enum { PACKED_SIDE_MAX = 1024 };
	struct cache_key coarse = cache_key_make("coarse packed"), detail = cache_key_make("detail packed");
	const struct cache_key thickness = thickness_key("thickness packed", clouds);
	add_field_inputs(&coarse, clouds);
	add_field_inputs(&detail, clouds);
	maps->thickness_packed = packed_get(stage->pack, context, &thickness, maps->thickness, TEXTURE_RGBA32F);
	if (clouds->resolution > PACKED_SIDE_MAX)
		return maps->thickness_packed;
	maps->coarse_packed = packed_get(stage->pack, context, &coarse, maps->coarse, TEXTURE_RGBA32F);
	maps->detail_packed = packed_get(stage->pack, context, &detail, maps->detail, TEXTURE_RGBA16F);
	return maps->thickness_packed && maps->coarse_packed && maps->detail_packed;
}

unsigned field_uses(const struct scene *scene)
{
	if (scene->camera.position_m[2] < scene->clouds.base_m)
		return FIELD_FROM_BELOW;
	return scene->ground.type == GROUND_SEA ? FIELD_FROM_ABOVE | FIELD_FROM_BELOW : FIELD_FROM_ABOVE;
}

bool field_stage_run(const struct field_stage *stage, struct stage_context *context, const struct scene *scene, unsigned uses,
		     struct field_maps *maps)
{
	*maps = (struct field_maps){0};
	fill_block(&context->block, &scene->clouds);
	if (context->block.cloud_layer[3] < 0.5f) {
		context->reused = false; /* nothing to remember */
		stage_upload_block(context);
		return true;
	}
	stage_upload_block(context);
	const struct coarse_field *coarse = coarse_field_get(stage, context, scene);
	if (!coarse)
		return stage_fails(context, "field");
	fill_threshold(&context->block, &scene->clouds, coarse->histogram);
	stage_upload_block(context);
	maps->coarse = &coarse->coarse;
	maps->detail = &coarse->detail;
	if (!thickness_get(stage, context, scene, coarse, uses, maps) ||
	    (uses & FIELD_FROM_BELOW && !packed_maps_get(stage, context, &scene->clouds, maps)))
		return stage_fails(context, "field");
	return true;
}
