#include "renderer/stages/view.h"

#include "renderer/log.h"
#include "renderer/stages/colour.h"
#include "renderer/stages/ground.h"
#include "renderer/stages/view_rows.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* OpenGL grants 16 samplers; each side leaves some out. */
#define COMMON_SAMPLERS "transmittance_table", "sky_total", "sky_near", "air_to_layer", "air_to_end", "ground_map"
#define CLOUD_SAMPLERS  "phase_table", "event_table", "slab_table", "slab_slices", "ground_received", "cloud_received"

/* A sea has no picture of its own, but one of the sky. */
enum { GROUND_SAMPLER = 5 };

static const struct {
	const char *defines;
	const char *samplers[PASS_SAMPLERS_MAX];
} sides[VIEW_SIDES] = {
	[VIEW_CLEAR] = {"#define VIEW_CLOUDS 0\n#define VIEW_ABOVE 0\n", {COMMON_SAMPLERS}},
	[VIEW_BELOW] = {"#define VIEW_CLOUDS 1\n#define VIEW_ABOVE 0\n",
			{COMMON_SAMPLERS, CLOUD_SAMPLERS, "side_light", "field_coarse", "field_detail", "thickness_packed"}},
	[VIEW_ABOVE] = {"#define VIEW_CLOUDS 1\n#define VIEW_ABOVE 1\n",
			{COMMON_SAMPLERS, CLOUD_SAMPLERS, "height_light", "seen_place", "seen_light"}},
};
/* By codes of 8 bits, and twice that by a round picture. */
#define DEVELOP(defines_text)                                                                                                              \
	{                                                                                                                                  \
		.file = "shaders/passes/develop.glsl", .defines = defines_text, .outputs = 1, .samplers = { "picture" }                    \
	}
static const struct pass_desc develop_descs[VIEW_DEVELOPS] = {
	DEVELOP("#define DEVELOP_NEAR 0\n#define DEVELOP_ROUND 0\n"),
	DEVELOP("#define DEVELOP_NEAR 1\n#define DEVELOP_ROUND 0\n"),
	DEVELOP("#define DEVELOP_NEAR 0\n#define DEVELOP_ROUND 1\n"),
	DEVELOP("#define DEVELOP_NEAR 1\n#define DEVELOP_ROUND 1\n"),
};

/* Of what lies close by (shaders/lib/ground.glsl). */
static const enum view_ground grounds[GROUND_TYPE_COUNT] = {
	[GROUND_GRASS] = VIEW_GROWN, [GROUND_COUNTRY] = VIEW_GROWN, [GROUND_SEA] = VIEW_SEA, [GROUND_SEA_ICE] = VIEW_ICE};

enum view_ground view_ground_of(const struct scene *scene)
{
	return grounds[scene->ground.type];
}

/* Metres a pixel in which nothing is seen any more of what shaders/lib/ground_near.glsl leaves out then: tufts, and the finest of the
 * ragged edges of ice. Pixels are smallest below the camera. */
static const double near_end_m[VIEW_GROUNDS] = {[VIEW_GROWN] = 0.6, [VIEW_ICE] = 6};

static enum view_reach reach_of_scene(const struct scene *scene)
{
	const struct camera_view view = camera_view_of(scene, 0);
	if (!ground_has_regions(scene))
		return VIEW_NEAR;
	const double pixel = camera_pixel_angle(&view) * scene->camera.position_m[2];
	return pixel < near_end_m[view_ground_of(scene)] ? VIEW_NEAR_AND_FAR : VIEW_FAR;
}

struct pass *view_create_pass(const struct pass_compiler *compiler, const char *file, int outputs, const struct view_variant *variant)
{
	char defines[384];
	struct pass_desc desc = {.file = file, .defines = defines, .outputs = outputs};
	snprintf(defines, sizeof defines,
		 "%s%s#define VIEW_REGION %d\n#define VIEW_SOLVED %d\n#define VIEW_TWILIGHT %d\n#define VIEW_COLOR_ONLY %d\n"
		 "#define VIEW_PROJECTION %d\n#define VIEW_LARGE_SUN %d\n#define VIEW_GROUND %d\n"
		 "#define VIEW_GROUND_REGIONS %d\n#define VIEW_GROUND_CLOSE %d\n",
		 sides[variant->side].defines, variant->packed ? "#define FIELD_PACKED 1\n" : "", variant->region,
		 variant->shading == SHADING_SOLVED, variant->twilight, !variant->layers, variant->projection, variant->large_sun,
		 variant->ground, variant->reach != VIEW_NEAR, variant->reach != VIEW_FAR);
	memcpy(desc.samplers, sides[variant->side].samplers, sizeof desc.samplers);
	if (variant->ground == VIEW_SEA)
		desc.samplers[GROUND_SAMPLER] = "sea_sky";
	return pass_create(compiler, &desc);
}

/* NULL (and log lines with the driver's message) when it does not compile. */
static struct pass *pass_of(struct view_stage *stage, const struct view_variant *variant)
{
	struct pass **pass = &stage->passes[variant->shading][variant->side][variant->twilight][variant->layers][variant->region]
					   [variant->projection][variant->large_sun][variant->packed][variant->ground][variant->reach];
	if (!*pass)
		*pass = view_create_pass(&stage->compiler, "shaders/passes/view.glsl", variant->layers ? VIEW_OUTPUTS : 1, variant);
	return *pass;
}

bool view_stage_init(struct view_stage *stage, const struct pass_compiler *compiler)
{
	stage->compiler = *compiler;
	view_samples_init(&stage->samples, compiler);
	bool ok = stage_create_passes(compiler, develop_descs, stage->develop, VIEW_DEVELOPS) && view_up_init(&stage->up, compiler) &&
		  height_view_init(&stage->height, compiler);
	for (int side = 0; ok && side < VIEW_SIDES; side++)
		for (int region = 0; ok && region < VIEW_REGIONS; region++)
			ok = (side == VIEW_BELOW && region == VIEW_SKY) ||
			     pass_of(stage, &(struct view_variant){.side = side,
								   .region = region,
								   .shading = SHADING_SOLVED,
								   .packed = side == VIEW_BELOW,
								   .ground = VIEW_GROWN});
	if (!ok)
		view_stage_finish(stage);
	return ok;
}

void view_stage_finish(struct view_stage *stage)
{
	struct pass **passes = &stage->passes[0][0][0][0][0][0][0][0][0][0];
	for (size_t i = 0; i < sizeof stage->passes / sizeof *passes; i++)
		pass_destroy(passes[i]);
	view_up_finish(&stage->up);
	stage_destroy_passes(stage->develop, VIEW_DEVELOPS);
	texture_finish(&stage->spare);
	disc_buffer_finish(&stage->disc);
	height_view_finish(&stage->height);
	view_samples_finish(&stage->samples);
	*stage = (struct view_stage){0};
}

static void set4(float *to, double x, double y, double z, double w)
{
	to[0] = (float)x;
	to[1] = (float)y;
	to[2] = (float)z;
	to[3] = (float)w;
}

/* Phases at the camera of the waves that shift the tile's copies against each other; they move with the clouds. An uploaded map is a tile
 * that somebody wants to see as it is. */
static void fill_warp(struct scene_block *block, const struct scene *scene)
{
	static const double waves[3][2] = {{0.4158, 0.1271}, {0.0726, 0.3143}, {-0.1701, 0.1586}}; /* shaders/lib/field_warp.glsl */
	const struct scene_clouds *clouds = &scene->clouds;
	for (int i = 0; i < 3; i++) {
		double turns = fmod((i + 1) * 0.6180339887 * clouds->seed, 1);
		for (int axis = 0; axis < 2; axis++)
			turns += waves[i][axis] * (scene->camera.position_m[axis] - clouds->wind_mps[axis] * clouds->time_s) /
				 clouds->tile_m;
		block->cloud_warp[i] = (float)(turns - floor(turns));
	}
	block->cloud_warp[3] = clouds->map.map ? 0 : 1;
}

void view_fill_camera(struct scene_block *block, const struct scene *scene, const struct camera_view *view)
{
	const double(*axes)[3] = view->axes;
	const double tile = scene->clouds.tile_m;
	const double x = scene->camera.position_m[0], y = scene->camera.position_m[1], z = scene->camera.position_m[2];
	set4(block->camera_position, x - tile * floor(x / tile), y - tile * floor(y / tile), z, camera_pixel_angle(view));
	fill_warp(block, scene);
	set4(block->camera_right, axes[0][0], axes[0][1], axes[0][2], view->tangent[0]);
	set4(block->camera_up, axes[1][0], axes[1][1], axes[1][2], view->tangent[1]);
	set4(block->camera_forward, axes[2][0], axes[2][1], axes[2][2], view->first_row);
	set4(block->image_size, view->width, view->height, 1.0 / view->width, 1.0 / view->height);
}

void view_fill_block(struct scene_block *block, const struct scene *scene)
{
	double matrix[3][3];
	const struct camera_view view = camera_view_of(scene, 0);
	view_fill_camera(block, scene, &view);
	colour_band_matrix(matrix);
	set4(block->band_red, matrix[0][0], matrix[1][0], matrix[2][0], 0);
	set4(block->band_green, matrix[0][1], matrix[1][1], matrix[2][1], 0);
	set4(block->band_blue, matrix[0][2], matrix[1][2], matrix[2][2], 0);
}

/* A color alone is made by other programs than one among layers, which is exactly their sum. */
static struct cache_key make_key(const struct scene *scene, enum layer layer, bool alone)
{
	const struct scene_camera *camera = &scene->camera;
	const double inputs[] = {layer,
				 alone,
				 scene->output.width,
				 scene->output.height,
				 camera->position_m[0],
				 camera->position_m[1],
				 camera->position_m[2],
				 camera->azimuth_deg,
				 camera->elevation_deg,
				 camera->roll_deg,
				 camera->vertical_fov_deg,
				 camera->projection,
				 camera->face,
				 scene->model.paths};
	struct cache_key key = cache_key_make("view");
	for (size_t i = 0; i < sizeof inputs / sizeof *inputs; i++)
		cache_key_add(&key, inputs[i]);
	stage_key_add_light(&key, scene);
	return key;
}

/* What the cache keeps of a layer. */
struct picture {
	struct texture texture;
	struct texture *spare; /* of the stage */
};

/* The memory of a picture is worth keeping: software renderers clear what they allocate. */
static void picture_destroy(void *value)
{
	struct picture *picture = value;
	texture_finish(picture->spare);
	*picture->spare = picture->texture;
	free(picture);
}

static struct picture *picture_create(struct view_stage *stage, const struct scene *scene)
{
	struct picture *picture = calloc(1, sizeof *picture);
	struct texture *spare = &stage->spare;
	const int width = scene->output.width, height = scene->output.height;
	if (!picture) {
		log_error("view: out of memory");
		return NULL;
	}
	picture->spare = spare;
	if (spare->id && spare->width == width && spare->height == height) {
		picture->texture = *spare;
		*spare = (struct texture){0};
	} else if (!texture_init(&picture->texture, width, height, TEXTURE_RGBA32F, TEXTURE_NEAREST)) {
		free(picture);
		return NULL;
	}
	return picture;
}

static enum view_side side_of(const struct scene *scene, const struct view_inputs *in)
{
	if (!in->light)
		return VIEW_CLEAR;
	return scene->camera.position_m[2] < scene->clouds.base_m ? VIEW_BELOW : VIEW_ABOVE;
}

/* In the order of COMMON_SAMPLERS, CLOUD_SAMPLERS and what the side adds. */
void view_bind_inputs(struct pass_run *run, enum view_side side, const struct view_inputs *in)
{
	const struct texture *common[] = {in->sky->transmittance, in->sky->total,  in->sky->near,
					  in->sky->to_layer,      in->sky->to_end, in->ground->map};
	const int common_count = sizeof common / sizeof *common;
	memcpy(run->samplers, common, sizeof common);
	if (in->sea_sky)
		run->samplers[GROUND_SAMPLER] = in->sea_sky;
	if (side == VIEW_CLEAR)
		return;
	const bool above = side == VIEW_ABOVE, packed = in->field->coarse_packed;
	const struct texture *clouds[] = {&in->droplets->phase,
					  &in->droplets->events,
					  in->slab_rows,
					  in->slab_slices,
					  in->light->ground_received,
					  in->light->cloud_received,
					  above ? &in->field->light->surface : in->field->sides,
					  above    ? (in->seen ? &in->seen->place : NULL)
					  : packed ? in->field->coarse_packed
						   : in->field->coarse,
					  above    ? (in->seen ? &in->seen->light : NULL)
					  : packed ? in->field->detail_packed
						   : in->field->detail,
					  above ? NULL : in->field->thickness_packed};
	memcpy(run->samplers + common_count, clouds, sizeof clouds);
}

/* Pixels a side of the pieces that are looked at together whether their views are low. */
enum { PIECE_SIDE = 32 };

/* Pixels that look up at the layer and have this in common; where they lie, and of which picture, is laid down in a run. */
struct up_pixels {
	enum projection projection;
	bool packed;
	enum view_up_reach reach;
	enum view_up_disc disc;
	int details;
};

static bool run_up_columns(struct view_stage *stage, struct up_pixels pixels, const struct pass_run *run, int first, int end)
{
	const struct pass *pass = view_up_pass(&stage->up, pixels.projection, pixels.packed, pixels.reach, pixels.disc, pixels.details);
	struct pass_run columns = *run;
	columns.first_column = first;
	columns.width = end - first;
	if (pass)
		pass_run(pass, &columns);
	return pass;
}

/* Rows of which some views are low: those that are, and those that are not, by programs of their own. */
static bool run_up_some_low(struct view_stage *stage, const struct scene_block *block, const struct camera_view *view,
			    struct up_pixels pixels, const struct pass_run *run)
{
	const int row = run->first_row, end_row = row + run->height;
	for (int first = 0, next; first < run->width; first = next) {
		pixels.reach = view_rows_low(block, view, row, end_row, first, first + PIECE_SIDE);
		for (next = first + PIECE_SIDE; next < run->width; next += PIECE_SIDE)
			if (view_rows_low(block, view, row, end_row, next, next + PIECE_SIDE) != pixels.reach)
				break;
		if (!run_up_columns(stage, pixels, run, first, next < run->width ? next : run->width))
			return false;
	}
	return true;
}

/* Rows [first, end) up at the layer. */
static bool run_up(struct view_stage *stage, const struct scene_block *block, const struct camera_view *view, struct view_variant variant,
		   struct pass_run *run, int first, int end)
{
	struct up_pixels pixels = {.projection = variant.projection, .packed = variant.packed, .details = (int)block->cloud_field[2]};
	for (int next; first < end; first = next) {
		const enum view_up_reach reach = pixels.reach = view_rows_reach(block, view, first);
		pixels.disc = view_rows_disc(block, variant.large_sun, first);
		for (next = first + 1; next < end; next++)
			if ((reach == VIEW_UP_SOME_LOW && next - first == PIECE_SIDE) || view_rows_reach(block, view, next) != reach ||
			    view_rows_disc(block, variant.large_sun, next) != pixels.disc)
				break;
		run->first_row = first;
		run->height = next - first;
		if (pixels.reach == VIEW_UP_NEAR && pixels.disc != VIEW_UP_NO_DISC)
			pixels.reach = VIEW_UP_FAR; /* no program is worth making for a few rows */
		if (!(pixels.reach == VIEW_UP_SOME_LOW ? run_up_some_low(stage, block, view, pixels, run)
						       : run_up_columns(stage, pixels, run, 0, run->width)))
			return false;
	}
	return true;
}

/* Runs over rows [first, last) of one kind after the other, each with the program made for it. `up`: how those that look up at the layer
 * are run, or NULL for the ordinary program. */
static bool run_regions(struct view_stage *stage, const struct stage_context *context, const struct camera_view *view, int first, int last,
			struct view_variant variant, struct pass_run *run, struct pass_run *up)
{
	while (first < last) {
		variant.region = view_rows_region(&context->block, view, variant.side == VIEW_ABOVE, first);
		int end = first + 1;
		while (end < last && view_rows_region(&context->block, view, variant.side == VIEW_ABOVE, end) == variant.region)
			end++;
		if (up && variant.region == VIEW_SKY) {
			if (!run_up(stage, &context->block, view, variant, up, first, end))
				return false;
		} else {
			const struct pass *pass = pass_of(stage, &variant);
			if (!pass)
				return false;
			run->first_row = first;
			run->height = end - first;
			pass_run(pass, run);
		}
		first = end;
	}
	return true;
}

/* Rows [first, last) with one program. Pictures that are rare have no programs for their parts. */
static bool run_whole(struct view_stage *stage, int first, int last, struct view_variant variant, struct pass_run *run)
{
	variant.region = VIEW_MIXED;
	const struct pass *pass = pass_of(stage, &variant);
	run->first_row = first;
	run->height = last - first;
	if (pass)
		pass_run(pass, run);
	return pass;
}

/* Programs made only for this picture are not worth making three of. */
static bool is_rare(const struct view_variant *variant)
{
	return variant->layers || variant->twilight;
}

/* What rows [first, last) of a view see of the layer below the camera; with all: also those that only see the sky. */
static bool see_rows(struct view_stage *stage, struct stage_context *context, const struct scene *scene, const struct camera_view *view,
		     const struct view_inputs *in, bool all, int first, int last, struct height_view *seen)
{
	bool ok = true;
	for (int end; ok && first < last; first = end) {
		const bool sky = !all && view_rows_region(&context->block, view, true, first) == VIEW_SKY;
		for (end = first + 1; end < last && !all; end++)
			if (sky != (view_rows_region(&context->block, view, true, end) == VIEW_SKY))
				break;
		end = all ? last : end;
		ok = sky || height_view_run(&stage->height, scene, view, in->field, &in->droplets->phase, first, end, seen);
	}
	return ok;
}

/* Pixels between two questions whether to go on: a second at most, of one layer or of many, in software. Smaller pictures run as one. */
enum { ASK_PIXELS = 1 << 20 };

/* Waits for what was drawn, since the driver takes commands faster than it carries them out. */
static bool is_given_up(const struct view_stage *stage)
{
	if (!stage->cancelled)
		return false;
	glFinish();
	return stage->cancelled(stage->cancel_context);
}

/* Rows of one view, as many at a time as are drawn without asking, or as is held of what they see of the layer below the camera. */
static bool run_view(struct view_stage *stage, struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
		     const struct camera_view *view, struct view_variant variant, struct pass_run *run, struct pass_run *up)
{
	struct height_view *seen = variant.side == VIEW_ABOVE ? inputs->seen : NULL;
	const bool rare = is_rare(&variant), in_parts = seen && seen->place.height < scene->output.height;
	const int last = view->first_row + view->height, some = ASK_PIXELS / run->width;
	for (int first = view->first_row, end; first < last; first = end) {
		const int held = in_parts && seen->place.height < some ? seen->place.height : some;
		end = first + held < last ? first + held : last;
		if (first > view->first_row && is_given_up(stage))
			return false;
		if (in_parts) {
			seen->first_row = first;
			if (!see_rows(stage, context, scene, view, inputs, rare, first, end, seen))
				return false;
		}
		run->arguments[3][2] = seen ? (float)seen->first_row : 0;
		if (!(rare ? run_whole(stage, first, end, variant, run) : run_regions(stage, context, view, first, end, variant, run, up)))
			return false;
	}
	return true;
}

/* One view of the picture after the other. */
static bool run_views(struct view_stage *stage, struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
		      struct view_variant variant, struct view_samples samples, struct pass_run *run)
{
	const bool fast = !is_rare(&variant) && variant.side == VIEW_BELOW && variant.shading == SHADING_SOLVED;
	struct pass_run up = {.targets = run->targets, .width = run->targets[0]->width};
	const struct view_up_inputs from = {.droplets = inputs->droplets,
					    .slab_rows = inputs->slab_rows,
					    .slab_slices = inputs->slab_slices,
					    .sky = inputs->sky,
					    .field = inputs->field,
					    .light = inputs->light};
	if (fast && !view_up_prepare(&stage->up, context, scene, &from, &up))
		return false;
	run->width = run->targets[0]->width;
	for (int i = 0; i < camera_view_count(scene); i++) {
		const struct camera_view view = camera_view_of(scene, i);
		variant.projection = view.projection;
		variant.large_sun = samples.per_side == 1 && stage->disc.views[i].large;
		view_fill_camera(&context->block, scene, &view);
		disc_buffer_bind(&stage->disc, i, &context->block);
		context->block.camera_position[3] *= (float)samples.footprint;
		if (samples.per_side > 1)
			set4(context->block.sun_disc_box, 0, 0, 0, 0);
		stage_upload_block(context);
		if (!run_view(stage, context, scene, inputs, &view, variant, run, fast ? &up : NULL))
			return false;
	}
	return true;
}

/* A clear sky has neither shading nor a layer to be lit from below. */
struct view_variant view_variant_of(const struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
				    bool layers)
{
	const enum view_side side = side_of(scene, inputs);
	const enum view_ground ground = view_ground_of(scene);
	if (side == VIEW_CLEAR)
		return (struct view_variant){
			.side = side, .shading = SHADING_SOLVED, .layers = layers, .ground = ground, .reach = reach_of_scene(scene)};
	return (struct view_variant){.side = side,
				     .shading = scene->model.shading,
				     .twilight = context->block.slab_light[1] > 0,
				     .layers = layers,
				     .packed = side == VIEW_BELOW && inputs->field->coarse_packed,
				     .ground = ground,
				     .reach = reach_of_scene(scene)};
}

/* The picture with so many rays a side of a pixel. */
static struct scene scene_of_rays(const struct scene *scene, int per_side)
{
	struct scene fine = *scene;
	fine.output.width *= per_side;
	fine.output.height *= per_side;
	return fine;
}

/* Averages the rays that were run into pixels. */
static bool reduce_views(struct view_stage *stage, struct stage_context *context, const struct scene *scene, int per_side,
			 const enum layer *layers, int count, const struct texture *rays, struct picture *const *pictures)
{
	bool ok = true;
	for (int i = 0; i < camera_view_count(scene); i++) {
		const struct camera_view view = camera_view_of(scene, i);
		view_fill_camera(&context->block, scene, &view);
		disc_buffer_bind(&stage->disc, i, &context->block);
		stage_upload_block(context);
		for (int k = 0; ok && k < count; k++)
			ok = view_samples_reduce(&stage->samples, &view, per_side, layers[k], scene->model.paths, &rays[k],
						 &pictures[k]->texture);
	}
	return ok;
}

/* Renders up to VIEW_OUTPUTS layers in one pass and hands them to the cache. alone: the color of all paths, and nothing else, is wanted. */
static bool run_group(struct view_stage *stage, struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
		      struct view_samples samples, const enum layer *layers, int count, bool alone, const struct texture **textures)
{
	const int per_side = samples.per_side;
	struct picture *pictures[VIEW_OUTPUTS] = {0};
	struct texture *targets[VIEW_OUTPUTS] = {0}, rays[VIEW_OUTPUTS] = {0};
	const struct scene fine = scene_of_rays(scene, per_side);
	bool ok = false;
	struct pass_run run = {.targets = targets};
	const struct view_variant variant = view_variant_of(context, scene, inputs, !alone);
	for (int i = 0; i <= LAYER_AIR - LAYER_SUN_DIRECT; i++)
		run.arguments[1 + i / 4][i % 4] = (float)(scene->model.paths >> i & 1);
	view_bind_inputs(&run, variant.side, inputs);
	for (int i = 0; i < count; i++) {
		run.arguments[0][i] = (float)layers[i];
		pictures[i] = picture_create(stage, scene);
		if (!pictures[i] ||
		    (per_side > 1 && !texture_init(&rays[i], fine.output.width, fine.output.height, TEXTURE_RGBA32F, TEXTURE_NEAREST)))
			goto end;
		targets[i] = per_side > 1 ? &rays[i] : &pictures[i]->texture;
	}
	if (!run_views(stage, context, &fine, inputs, variant, samples, &run) ||
	    (per_side > 1 && !reduce_views(stage, context, scene, per_side, layers, count, rays, pictures)))
		goto end;
	for (int i = 0; i < count; i++) {
		const struct cache_key key = make_key(scene, layers[i], alone);
		struct picture *picture = pictures[i];
		pictures[i] = NULL;
		if (!cache_keep(context->cache, &key, picture, texture_bytes(&picture->texture), picture_destroy))
			goto end;
		textures[i] = &picture->texture;
	}
	ok = true;

end:
	for (int i = 0; i < count; i++) {
		if (pictures[i])
			picture_destroy(pictures[i]);
		texture_finish(&rays[i]);
	}
	return ok;
}

/* What the picture sees of the layer below the camera, one view after the other; of one too large to be held it is left to those who draw
 * it. */
static bool see_layer(struct view_stage *stage, struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
		      bool alone, struct height_view *seen)
{
	const struct view_variant variant = view_variant_of(context, scene, inputs, !alone);
	bool ok = height_view_create(scene, seen);
	const bool whole = ok && seen->place.height == scene->output.height;
	for (int i = 0; whole && ok && i < camera_view_count(scene); i++) {
		const struct camera_view view = camera_view_of(scene, i);
		view_fill_camera(&context->block, scene, &view);
		stage_upload_block(context);
		ok = see_rows(stage, context, scene, &view, inputs, is_rare(&variant), view.first_row, view.first_row + view.height, seen);
	}
	return ok;
}

bool view_stage_run(struct view_stage *stage, struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
		    const enum layer *layers, int count, renderer_cancelled *cancelled, void *cancel_context,
		    const struct texture **pictures)
{
	enum layer missing[LAYER_COUNT];
	const bool alone = count == 1 && layers[0] == LAYER_COLOR && scene->model.paths == SCENE_PATHS_ALL;
	int place[LAYER_COUNT], missing_count = 0;
	for (int i = 0; i < count; i++) {
		const struct cache_key key = make_key(scene, layers[i], alone);
		const struct picture *picture = cache_find(context->cache, &key);
		if (picture) {
			pictures[i] = &picture->texture;
		} else {
			place[missing_count] = i;
			missing[missing_count++] = layers[i];
		}
	}
	if (missing_count == 0)
		return true;
	context->reused = false;
	stage->cancelled = cancelled;
	stage->cancel_context = cancel_context;
	struct height_view seen = {0};
	struct view_inputs with_seen = *inputs;
	with_seen.seen = &seen;
	const struct view_samples samples = side_of(scene, inputs) == VIEW_BELOW ? view_samples_of(scene) : (struct view_samples){1, 1};
	bool ok = disc_buffer_fill(&stage->disc, &context->block, scene, view_rows_horizon(&context->block, 0), inputs->sun_cover) &&
		  (side_of(scene, inputs) != VIEW_ABOVE || see_layer(stage, context, scene, inputs, alone, &seen));
	for (int i = 0; ok && i < missing_count;) {
		const int left = missing_count - i, group = left < VIEW_OUTPUTS ? left : VIEW_OUTPUTS;
		const struct texture *made[VIEW_OUTPUTS] = {0};
		ok = !(cancelled && cancelled(cancel_context)) &&
		     run_group(stage, context, scene, &with_seen, samples, missing + i, group, alone, made);
		for (int k = 0; k < group; k++)
			pictures[place[i + k]] = made[k];
		i += group;
	}
	height_view_release(&seen);
	return ok;
}

void view_develop(const struct view_stage *stage, const struct texture *picture, bool round_picture, struct texture *target)
{
	pass_run(stage->develop[(target->format == TEXTURE_RGBA8) + 2 * round_picture],
		 &(struct pass_run){.targets = &target, .samplers = {picture}});
}
