#include "renderer/stages/field.h"

#include "renderer/log.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdlib.h>

enum { PASS_COARSE, PASS_DETAIL, PASS_HISTOGRAM, PASS_HEIGHT, PASS_MAXIMUM, PASS_SMOOTH };

static const struct pass_desc pass_descs[FIELD_PASS_COUNT] = {
	[PASS_COARSE] = {.file = "shaders/passes/field_coarse.glsl", .outputs = 1},
	[PASS_DETAIL] = {.file = "shaders/passes/field_detail.glsl", .outputs = 1},
	[PASS_HISTOGRAM] = {.file = "shaders/passes/field_histogram.glsl", .outputs = 0, .samplers = {"field_coarse", "field_detail"}},
	[PASS_HEIGHT] = {.file = "shaders/passes/height_base.glsl", .outputs = 1, .samplers = {"field_coarse", "field_detail"}},
	[PASS_MAXIMUM] = {.file = "shaders/passes/height_maximum.glsl", .outputs = 1, .samplers = {"height_below"}},
	[PASS_SMOOTH] = {.file = "shaders/passes/height_smooth.glsl", .outputs = 1, .samplers = {"thickness"}},
};

/* HEIGHT_SIDE and SMOOTH_SIDE as in shaders/lib/height.glsl, DETAIL_SIDE as in shaders/lib/field.glsl. */
enum { DETAIL_SIDE = 512, HEIGHT_SIDE = 1024, SMOOTH_SIDE = 256, HISTOGRAM_BINS = 4096 };

/* Densities are sums of noise within -3..3 and cells within 0..1, with weights below 1: nothing lies outside. */
static const double density_lowest = -5, density_highest = 6;

/* What the types differ in beside the noise itself. */
static const struct {
	double exponent;      /* of H over the density above its threshold */
	double detail_weight; /* of the detail below the texel */
	double overcast_lift; /* share of the range by which the threshold sinks below all densities as coverage reaches 1 */
} shapes[CLOUD_TYPE_COUNT] = {
	[CLOUD_STRATUS] = {0.6, 0.05, 0.4},
	[CLOUD_STRATOCUMULUS] = {0.75, 0.09, 0.10},
};

/* Detail repeats after about this length (the tile divided by a whole number), in m. */
static const double detail_tile_m = 2500;
/* The turbulence drifts faster than the cells, being higher up in the shear. */
static const double turbulence_shear = 0.08;

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

struct height_field {
	struct texture height, maximum;
};

static void height_field_destroy(void *value)
{
	struct height_field *field = value;
	if (!field)
		return;
	texture_finish(&field->maximum);
	texture_finish(&field->height);
	free(field);
}

bool field_stage_init(struct field_stage *stage, const struct pass_compiler *compiler)
{
	if (!stage_create_passes(compiler, pass_descs, stage->passes, FIELD_PASS_COUNT))
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
	stage_destroy_passes(stage->passes, FIELD_PASS_COUNT);
}

/* A whole number that a float holds exactly, with every bit of the seed mixed in. */
static double seed_number(uint32_t seed)
{
	uint32_t x = seed + 0x9e3779b9u;
	x = (x ^ (x >> 16)) * 0x85ebca6bu;
	x = (x ^ (x >> 13)) * 0xc2b2ae35u;
	return (x ^ (x >> 16)) & 0xffffff;
}

static double wrap(double x, double period)
{
	return x - period * floor(x / period);
}

static void fill_block(struct scene_block *block, const struct scene_clouds *clouds)
{
	const double tile = clouds->tile_m;
	const double detail = tile / fmax(1, round(tile / detail_tile_m));
	const double east = clouds->wind_mps[0] * clouds->time_s, north = clouds->wind_mps[1] * clouds->time_s;
	block->cloud_layer[0] = (float)clouds->base_m;
	block->cloud_layer[1] = (float)clouds->thickness_m;
	block->cloud_layer[2] = (float)tile;
	block->cloud_layer[3] = clouds->type != CLOUD_NONE && clouds->thickness_m > 0 ? 1.0f : 0.0f;
	block->cloud_field[0] = (float)seed_number(clouds->seed);
	block->cloud_field[1] = (float)clouds->coverage;
	block->cloud_field[2] = (float)clouds->time_s;
	block->cloud_field[3] = (float)clouds->type;
	block->cloud_drift[0] = (float)wrap(east, tile);
	block->cloud_drift[1] = (float)wrap(north, tile);
	block->cloud_drift[2] = (float)wrap(turbulence_shear * east, tile);
	block->cloud_drift[3] = (float)wrap(turbulence_shear * north, tile);
	block->cloud_detail[0] = (float)detail;
	block->cloud_detail[1] = (float)wrap(turbulence_shear * east, detail);
	block->cloud_detail[2] = (float)wrap(turbulence_shear * north, detail);
	block->cloud_detail[3] = (float)shapes[clouds->type].detail_weight;
	block->cloud_threshold[3] = (float)clouds->resolution;
}

static void count_densities(const struct field_stage *stage, const struct coarse_field *field)
{
	const unsigned zero = 0;
	glClearNamedBufferData(stage->histogram, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
	glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, stage->histogram);
	/* 512 x 512 places are enough for quantiles to a thousandth, whatever the resolution. */
	const int side = field->coarse.width < 512 ? field->coarse.width : 512;
	pass_run(stage->passes[PASS_HISTOGRAM],
		 &(struct pass_run){.width = side,
				    .height = side,
				    .samplers = {&field->coarse, &field->detail},
				    .arguments = {{(float)density_lowest, (float)density_highest, HISTOGRAM_BINS,
						   (float)field->coarse.width / (float)side}}});
	glGetNamedBufferSubData(stage->histogram, 0, HISTOGRAM_BINS * sizeof(unsigned), field->histogram);
}

static struct coarse_field *coarse_field_compute(const struct field_stage *stage, int resolution)
{
	struct coarse_field *field = calloc(1, sizeof *field);
	if (!field)
		return NULL;
	field->histogram = calloc(HISTOGRAM_BINS, sizeof *field->histogram);
	if (!field->histogram || !texture_init(&field->coarse, resolution, resolution, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS) ||
	    !texture_init(&field->detail, DETAIL_SIDE, DETAIL_SIDE, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS)) {
		coarse_field_destroy(field);
		return NULL;
	}
	pass_run(stage->passes[PASS_COARSE], &(struct pass_run){.targets = (struct texture *[]){&field->coarse}});
	pass_run(stage->passes[PASS_DETAIL],
		 &(struct pass_run){.targets = (struct texture *[]){&field->detail}, .arguments = {{(float)DETAIL_SIDE}}});
	texture_build_mipmaps(&field->coarse);
	texture_build_mipmaps(&field->detail);
	count_densities(stage, field);
	return field;
}

static void add_field_inputs(struct cache_key *key, const struct scene_clouds *clouds)
{
	const double inputs[] = {clouds->type,       clouds->seed,        clouds->time_s,     clouds->tile_m,
				 clouds->resolution, clouds->wind_mps[0], clouds->wind_mps[1]};
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
	field = coarse_field_compute(stage, scene->clouds.resolution);
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
	const double bin = (density_highest - density_lowest) / (HISTOGRAM_BINS - 1);
	for (int i = 0; i < HISTOGRAM_BINS; i++) {
		if (histogram[i] > 0 && below + histogram[i] >= share * total)
			return density_lowest + bin * (i - 0.5 + (share * total - below) / histogram[i]);
		below += histogram[i];
	}
	return density_highest;
}

/* The threshold, from the densities as they are; under an overcast it sinks below them all, so that no hole is left. */
static void fill_threshold(struct scene_block *block, const struct scene_clouds *clouds, const unsigned *histogram)
{
	const double lowest = quantile(histogram, 0.0005), highest = quantile(histogram, 0.9995);
	double threshold = quantile(histogram, 1 - clouds->coverage);
	const double near_overcast = fmin(1, fmax(0, (clouds->coverage - 0.9) / 0.1));
	threshold -= shapes[clouds->type].overcast_lift * (highest - lowest) * near_overcast * near_overcast;
	if (clouds->coverage <= 0)
		threshold = density_highest;
	block->cloud_threshold[0] = (float)threshold;
	/* With hardly any coverage the range above the threshold would vanish; cloud that small stays thin. */
	block->cloud_threshold[1] = (float)(1 / fmax(highest - threshold, 0.15 * (highest - lowest)));
	block->cloud_threshold[2] = (float)shapes[clouds->type].exponent;
}

/* Level 0 from the heights, each further level from the one below it, read through a view of it alone: levels that are being written must
 * not be within a sampler's reach. */
static void maximum_level(const struct field_stage *stage, struct height_field *field, int level)
{
	struct texture below = level == 0 ? field->height : texture_level(&field->maximum, level - 1);
	pass_run(stage->passes[PASS_MAXIMUM], &(struct pass_run){.targets = (struct texture *[]){&field->maximum},
								 .level = level,
								 .samplers = {&below},
								 .arguments = {{(float)(HEIGHT_SIDE >> level), level == 0 ? 1 : 0}}});
	if (level > 0)
		texture_finish(&below);
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

static struct height_field *height_field_compute(const struct field_stage *stage, const struct coarse_field *coarse)
{
	struct height_field *field = calloc(1, sizeof *field);
	if (!field)
		return NULL;
	if (!height_compute(stage, coarse, HEIGHT_SIDE, &field->height) ||
	    !texture_init(&field->maximum, HEIGHT_SIDE / 2, HEIGHT_SIDE / 2, TEXTURE_R32F,
			  TEXTURE_REPEAT | TEXTURE_NEAREST | TEXTURE_MIPMAPS)) {
		height_field_destroy(field);
		return NULL;
	}
	for (int level = 0; level < field->maximum.levels; level++)
		maximum_level(stage, field, level);
	return field;
}

static struct cache_key thickness_key(const char *name, const struct scene_clouds *clouds)
{
	struct cache_key key = cache_key_make(name);
	add_field_inputs(&key, clouds);
	cache_key_add(&key, clouds->coverage);
	cache_key_add(&key, clouds->thickness_m);
	return key;
}

static const struct height_field *height_field_get(const struct field_stage *stage, struct stage_context *context,
						   const struct scene *scene, const struct coarse_field *coarse)
{
	const struct cache_key key = thickness_key("height", &scene->clouds);
	struct height_field *field = cache_find(context->cache, &key);
	if (field)
		return field;
	context->reused = false;
	field = height_field_compute(stage, coarse);
	if (!field ||
	    !cache_keep(context->cache, &key, field, texture_bytes(&field->height) + texture_bytes(&field->maximum), height_field_destroy))
		return NULL;
	return field;
}

static void texture_destroy(void *value)
{
	struct texture *texture = value;
	if (texture)
		texture_finish(texture);
	free(texture);
}

static struct texture *smooth_compute(const struct field_stage *stage, const struct coarse_field *coarse, double length_m)
{
	struct texture height = {0}, *smooth = calloc(1, sizeof *smooth);
	if (!smooth || !height_compute(stage, coarse, SMOOTH_SIDE, &height) ||
	    !texture_init(smooth, SMOOTH_SIDE, SMOOTH_SIDE, TEXTURE_R32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS)) {
		texture_finish(&height);
		free(smooth);
		return NULL;
	}
	pass_run(stage->passes[PASS_SMOOTH], &(struct pass_run){.targets = (struct texture *[]){smooth},
								.samplers = {&height},
								.arguments = {{SMOOTH_SIDE, (float)length_m}}});
	texture_build_mipmaps(smooth);
	texture_finish(&height);
	return smooth;
}

static const struct texture *smooth_get(const struct field_stage *stage, struct stage_context *context, const struct scene *scene,
					const struct coarse_field *coarse)
{
	const double length = context->block.slab_light[2];
	struct cache_key key = thickness_key("smooth", &scene->clouds);
	cache_key_add(&key, length);
	struct texture *smooth = cache_find(context->cache, &key);
	if (smooth)
		return smooth;
	context->reused = false;
	smooth = smooth_compute(stage, coarse, length);
	if (!smooth || !cache_keep(context->cache, &key, smooth, texture_bytes(smooth), texture_destroy))
		return NULL;
	return smooth;
}

static bool thickness_get(const struct field_stage *stage, struct stage_context *context, const struct scene *scene,
			  const struct coarse_field *coarse, bool from_above, struct field_maps *maps)
{
	maps->smooth = smooth_get(stage, context, scene, coarse);
	if (!maps->smooth || !from_above)
		return maps->smooth;
	const struct height_field *height = height_field_get(stage, context, scene, coarse);
	if (!height)
		return false;
	maps->height = &height->height;
	maps->maximum = &height->maximum;
	return true;
}

/* Packed pictures take six times the memory. */
static bool packed_maps_get(const struct field_stage *stage, struct stage_context *context, const struct scene_clouds *clouds,
			    struct field_maps *maps)
{
	enum { PACKED_SIDE_MAX = 1024 };
	struct cache_key coarse = cache_key_make("coarse packed"), detail = cache_key_make("detail packed");
	struct cache_key smooth = thickness_key("smooth packed", clouds);
	add_field_inputs(&coarse, clouds);
	add_field_inputs(&detail, clouds);
	cache_key_add(&smooth, context->block.slab_light[2]);
	maps->smooth_packed = packed_get(stage->pack, context, &smooth, maps->smooth, TEXTURE_RGBA32F);
	if (clouds->resolution > PACKED_SIDE_MAX)
		return maps->smooth_packed;
	maps->coarse_packed = packed_get(stage->pack, context, &coarse, maps->coarse, TEXTURE_RGBA32F);
	maps->detail_packed = packed_get(stage->pack, context, &detail, maps->detail, TEXTURE_RGBA16F);
	return maps->smooth_packed && maps->coarse_packed && maps->detail_packed;
}

bool field_stage_run(const struct field_stage *stage, struct stage_context *context, const struct scene *scene, bool from_above,
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
	if (!coarse) {
		log_error("field: out of memory");
		return false;
	}
	fill_threshold(&context->block, &scene->clouds, coarse->histogram);
	stage_upload_block(context);
	maps->coarse = &coarse->coarse;
	maps->detail = &coarse->detail;
	if (!thickness_get(stage, context, scene, coarse, from_above, maps) ||
	    (!from_above && !packed_maps_get(stage, context, &scene->clouds, maps))) {
		log_error("field: out of memory");
		return false;
	}
	return true;
}
