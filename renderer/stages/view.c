#include "renderer/stages/view.h"

#include "renderer/log.h"
#include "renderer/stages/colour.h"

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
			{COMMON_SAMPLERS, CLOUD_SAMPLERS, "smooth_table", "field_coarse", "field_detail"}},
	[VIEW_ABOVE] = {"#define VIEW_CLOUDS 1\n#define VIEW_ABOVE 1\n",
			{COMMON_SAMPLERS, CLOUD_SAMPLERS, "height_light", "seen_place", "seen_light"}},
};
static const struct pass_desc develop_desc = {.file = "shaders/passes/develop.glsl", .outputs = 1, .samplers = {"picture"}};

/* Of what lies close by (shaders/lib/ground.glsl). */
static const enum view_ground grounds[GROUND_TYPE_COUNT] = {
	[GROUND_GRASS] = VIEW_GROWN, [GROUND_COUNTRY] = VIEW_GROWN, [GROUND_SEA] = VIEW_SEA, [GROUND_SEA_ICE] = VIEW_ICE};

struct pass *view_create_pass(const struct pass_compiler *compiler, const char *file, int outputs, const struct view_variant *variant)
{
	char defines[320];
	struct pass_desc desc = {.file = file, .defines = defines, .outputs = outputs};
	snprintf(defines, sizeof defines,
		 "%s#define VIEW_REGION %d\n#define VIEW_SOLVED %d\n#define VIEW_TWILIGHT %d\n#define VIEW_COLOR_ONLY %d\n"
		 "#define VIEW_PROJECTION %d\n#define VIEW_LARGE_SUN %d\n#define VIEW_GROUND %d\n",
		 sides[variant->side].defines, variant->region, variant->shading == SHADING_SOLVED, variant->twilight, !variant->layers,
		 variant->projection, variant->large_sun, variant->ground);
	memcpy(desc.samplers, sides[variant->side].samplers, sizeof desc.samplers);
	if (variant->ground == VIEW_SEA)
		desc.samplers[GROUND_SAMPLER] = "sea_sky";
	return pass_create(compiler, &desc);
}

/* NULL (and log lines with the driver's message) when it does not compile. */
static struct pass *pass_of(struct view_stage *stage, const struct view_variant *variant)
{
	struct pass **pass = &stage->passes[variant->shading][variant->side][variant->twilight][variant->layers][variant->region]
					   [variant->projection][variant->large_sun][variant->ground];
	if (!*pass)
		*pass = view_create_pass(&stage->compiler, "shaders/passes/view.glsl", variant->layers ? VIEW_OUTPUTS : 1, variant);
	return *pass;
}

bool view_stage_init(struct view_stage *stage, const struct pass_compiler *compiler)
{
	stage->compiler = *compiler;
	bool ok = (stage->develop = pass_create(compiler, &develop_desc)) != NULL && height_view_init(&stage->height, compiler);
	for (int side = 0; ok && side < VIEW_SIDES; side++)
		for (int region = 0; ok && region < VIEW_REGIONS; region++)
			ok = pass_of(stage, &(struct view_variant){
						    .side = side, .region = region, .shading = SHADING_SOLVED, .ground = VIEW_GROWN});
	if (!ok)
		view_stage_finish(stage);
	return ok;
}

void view_stage_finish(struct view_stage *stage)
{
	struct pass **passes = &stage->passes[0][0][0][0][0][0][0][0];
	for (size_t i = 0; i < sizeof stage->passes / sizeof *passes; i++)
		pass_destroy(passes[i]);
	pass_destroy(stage->develop);
	disc_buffer_finish(&stage->disc);
	height_view_finish(&stage->height);
	*stage = (struct view_stage){0};
}

static void set4(float *to, double x, double y, double z, double w)
{
	to[0] = (float)x;
	to[1] = (float)y;
	to[2] = (float)z;
	to[3] = (float)w;
}

static void fill_camera(struct scene_block *block, const struct scene *scene, const struct camera_view *view)
{
	const double(*axes)[3] = view->axes;
	const double tile = scene->clouds.tile_m;
	const double x = scene->camera.position_m[0], y = scene->camera.position_m[1], z = scene->camera.position_m[2];
	set4(block->camera_position, x - tile * floor(x / tile), y - tile * floor(y / tile), z, camera_pixel_angle(view));
	set4(block->camera_right, axes[0][0], axes[0][1], axes[0][2], view->tangent[0]);
	set4(block->camera_up, axes[1][0], axes[1][1], axes[1][2], view->tangent[1]);
	set4(block->camera_forward, axes[2][0], axes[2][1], axes[2][2], view->first_row);
	set4(block->image_size, view->width, view->height, 1.0 / view->width, 1.0 / view->height);
}

void view_fill_block(struct scene_block *block, const struct scene *scene)
{
	double matrix[3][3];
	const struct camera_view view = camera_view_of(scene, 0);
	fill_camera(block, scene, &view);
	colour_band_matrix(matrix);
	set4(block->band_red, matrix[0][0], matrix[1][0], matrix[2][0], 0);
	set4(block->band_green, matrix[0][1], matrix[1][1], matrix[2][1], 0);
	set4(block->band_blue, matrix[0][2], matrix[1][2], matrix[2][2], 0);
}

static struct cache_key make_key(const struct scene *scene, enum layer layer)
{
	const struct scene_camera *camera = &scene->camera;
	const double inputs[] = {layer,
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

static void picture_destroy(void *value)
{
	struct texture *picture = value;
	texture_finish(picture);
	free(picture);
}

static struct texture *picture_create(const struct scene *scene)
{
	struct texture *picture = calloc(1, sizeof *picture);
	if (picture && !texture_init(picture, scene->output.width, scene->output.height, TEXTURE_RGBA32F, TEXTURE_NEAREST)) {
		free(picture);
		picture = NULL;
	}
	if (!picture)
		log_error("view: out of memory");
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
	const bool above = side == VIEW_ABOVE;
	const struct texture *clouds[] = {&in->droplets->phase,
					  &in->droplets->events,
					  in->slab_rows,
					  in->slab_slices,
					  in->light->ground_received,
					  in->light->cloud_received,
					  above ? in->field->light : in->field->smooth,
					  above ? (in->seen ? &in->seen->place : NULL) : in->field->coarse,
					  above ? (in->seen ? &in->seen->light : NULL) : in->field->detail};
	memcpy(run->samplers + common_count, clouds, sizeof clouds);
}

/* Sine of the (negative) elevation of the horizon of a sphere `height` above the ground, seen from the camera; 1 from inside it. */
static double horizon_sine(const struct scene_block *block, double height)
{
	const double radius = 6371000.0, h = block->camera_position[2];
	return h < height ? 1 : -sqrt((h - height) * (2 * radius + h + height)) / (radius + h);
}

/* Least and greatest sine of the elevation along a row of pixels. That of a perspective rises and falls at most once along a row, so that
 * its ends, its middle and points between bound it, but for the bulge between those, the square of their distance. */
static void bound_row(const struct camera_view *view, int row, double *lowest, double *highest)
{
	enum { PROBES = 16 };
	const double bulge = view->projection == PROJECTION_PERSPECTIVE ? pow(view->tangent[0] / PROBES, 2) : 0;
	*lowest = 1;
	*highest = -1;
	for (int i = 0; i <= PROBES; i++) {
		const double at[2] = {(double)view->width * i / PROBES, row + 0.5};
		double direction[3];
		camera_direction(view, at, direction);
		*lowest = fmin(*lowest, direction[2] - bulge);
		*highest = fmax(*highest, direction[2] + bulge);
	}
}

/* What the rays of a row of pixels have in common, with a margin of two pixels. */
static enum view_region region_of_row(const struct scene_block *block, const struct camera_view *view, enum view_side side, int row)
{
	const double margin = 2 * camera_pixel_angle(view) + 1e-6, ground = horizon_sine(block, 0);
	/* From above, rays that miss the ground may still graze the layer. */
	const double sky = side == VIEW_ABOVE ? horizon_sine(block, block->cloud_layer[0] + block->cloud_layer[1]) : ground;
	double lowest, highest;
	if (view->projection == PROJECTION_FISHEYE)
		return sky < -1e-6 ? VIEW_SKY : VIEW_MIXED; /* it ends at elevation 0 */
	bound_row(view, row, &lowest, &highest);
	if (lowest > sky + margin)
		return VIEW_SKY;
	return highest < ground - margin ? VIEW_GROUND : VIEW_MIXED;
}

/* Runs over rows of one kind after the other, each with the program made for it. */
static bool run_regions(struct view_stage *stage, const struct stage_context *context, const struct camera_view *view,
			struct view_variant variant, struct pass_run *run)
{
	const int last = view->first_row + view->height;
	for (int first = view->first_row; first < last;) {
		variant.region = region_of_row(&context->block, view, variant.side, first);
		const struct pass *pass = pass_of(stage, &variant);
		if (!pass)
			return false;
		int end = first + 1;
		while (end < last && region_of_row(&context->block, view, variant.side, end) == variant.region)
			end++;
		run->first_row = first;
		run->height = end - first;
		pass_run(pass, run);
		first = end;
	}
	return true;
}

/* The whole with one program. Pictures that are rare have no programs for their parts. */
static bool run_whole(struct view_stage *stage, const struct camera_view *view, struct view_variant variant, struct pass_run *run)
{
	variant.region = VIEW_MIXED;
	const struct pass *pass = pass_of(stage, &variant);
	run->first_row = view->first_row;
	run->height = view->height;
	if (pass)
		pass_run(pass, run);
	return pass;
}

/* One view of the picture after the other. */
static bool run_views(struct view_stage *stage, struct stage_context *context, const struct scene *scene, struct view_variant variant,
		      struct pass_run *run)
{
	/* Programs made only for this picture are not worth making three of. */
	const bool whole = variant.layers || variant.twilight;
	run->width = run->targets[0]->width;
	for (int i = 0; i < camera_view_count(scene); i++) {
		const struct camera_view view = camera_view_of(scene, i);
		variant.projection = view.projection;
		variant.large_sun = stage->disc.views[i].large;
		fill_camera(&context->block, scene, &view);
		disc_buffer_bind(&stage->disc, i, &context->block);
		stage_upload_block(context);
		if (!(whole ? run_whole(stage, &view, variant, run) : run_regions(stage, context, &view, variant, run)))
			return false;
	}
	return true;
}

/* A clear sky has neither shading nor a layer to be lit from below. */
struct view_variant view_variant_of(const struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
				    bool layers)
{
	const enum view_side side = side_of(scene, inputs);
	const enum view_ground ground = grounds[scene->ground.type];
	if (side == VIEW_CLEAR)
		return (struct view_variant){.side = side, .shading = SHADING_SOLVED, .layers = layers, .ground = ground};
	return (struct view_variant){.side = side,
				     .shading = scene->model.shading,
				     .twilight = context->block.slab_light[1] > 0,
				     .layers = layers,
				     .ground = ground};
}

/* Renders up to VIEW_OUTPUTS layers in one pass and hands them to the cache. */
static bool run_group(struct view_stage *stage, struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
		      const enum layer *layers, int count, const struct texture **pictures)
{
	struct texture *targets[VIEW_OUTPUTS] = {0};
	struct pass_run run = {.targets = targets};
	const bool some_paths = scene->model.paths != SCENE_PATHS_ALL;
	const struct view_variant variant = view_variant_of(context, scene, inputs, count > 1 || layers[0] != LAYER_COLOR || some_paths);
	for (int i = 0; i <= LAYER_AIR - LAYER_SUN_DIRECT; i++)
		run.arguments[1 + i / 4][i % 4] = (float)(scene->model.paths >> i & 1);
	view_bind_inputs(&run, variant.side, inputs);
	for (int i = 0; i < count; i++) {
		run.arguments[0][i] = (float)layers[i];
		targets[i] = picture_create(scene);
		if (!targets[i])
			goto fail;
	}
	if (!run_views(stage, context, scene, variant, &run))
		goto fail;
	for (int i = 0; i < count; i++) {
		const struct cache_key key = make_key(scene, layers[i]);
		struct texture *picture = targets[i];
		targets[i] = NULL;
		if (!cache_keep(context->cache, &key, picture, texture_bytes(picture), picture_destroy))
			goto fail;
		pictures[i] = picture;
	}
	return true;

fail:
	for (int i = 0; i < count; i++)
		if (targets[i])
			picture_destroy(targets[i]);
	return false;
}

/* What the picture sees of the layer below the camera, one view after the other. */
static bool see_layer(struct view_stage *stage, struct stage_context *context, const struct scene *scene, const struct field_maps *field,
		      struct height_view *seen)
{
	bool ok = height_view_create(scene, seen);
	for (int i = 0; ok && i < camera_view_count(scene); i++) {
		const struct camera_view view = camera_view_of(scene, i);
		fill_camera(&context->block, scene, &view);
		stage_upload_block(context);
		ok = height_view_run(&stage->height, scene, &view, field, seen);
	}
	return ok;
}

bool view_stage_run(struct view_stage *stage, struct stage_context *context, const struct scene *scene, const struct view_inputs *inputs,
		    const enum layer *layers, int count, renderer_cancelled *cancelled, void *cancel_context,
		    const struct texture **pictures)
{
	enum layer missing[LAYER_COUNT];
	int place[LAYER_COUNT], missing_count = 0;
	for (int i = 0; i < count; i++) {
		const struct cache_key key = make_key(scene, layers[i]);
		pictures[i] = cache_find(context->cache, &key);
		if (!pictures[i]) {
			place[missing_count] = i;
			missing[missing_count++] = layers[i];
		}
	}
	if (missing_count == 0)
		return true;
	context->reused = false;
	struct height_view seen = {0};
	struct view_inputs with_seen = *inputs;
	with_seen.seen = &seen;
	bool ok = disc_buffer_fill(&stage->disc, &context->block, scene, horizon_sine(&context->block, 0)) &&
		  (side_of(scene, inputs) != VIEW_ABOVE || see_layer(stage, context, scene, inputs->field, &seen));
	for (int i = 0; ok && i < missing_count;) {
		const int left = missing_count - i, group = left < VIEW_OUTPUTS ? left : VIEW_OUTPUTS;
		const struct texture *made[VIEW_OUTPUTS] = {0};
		ok = !(cancelled && cancelled(cancel_context)) && run_group(stage, context, scene, &with_seen, missing + i, group, made);
		for (int k = 0; k < group; k++)
			pictures[place[i + k]] = made[k];
		i += group;
	}
	height_view_release(&seen);
	return ok;
}

void view_develop(const struct view_stage *stage, const struct texture *picture, struct texture *target)
{
	pass_run(stage->develop, &(struct pass_run){.targets = &target, .samplers = {picture}});
}
