#include "renderer/frame_job.h"

#include "renderer/exposure.h"
#include "renderer/scene_map.h"
#include "renderer/stages/colour.h"

#include <math.h>

static bool run_optics(struct frame_job *job)
{
	struct stage_context *context = &job->renderer->context;
	if (!scene_has_clouds(job->scene)) {
		context->reused = false; /* it does not run at all */
		return true;
	}
	job->droplets = droplets_get(context, job->scene);
	job->slab_rows = job->droplets ? slab_rows_get(context, job->scene, job->droplets) : NULL;
	return job->slab_rows && slab_slices_get(context, job->scene, job->droplets, &job->slab_slices);
}

/* Reflectance of a deck of this thickness over the ground, with all light between them. */
static double deck_albedo(const struct frame_job *job, int band, double thickness_m)
{
	const struct droplet_tables *droplets = job->droplets->tables;
	const double tau = thickness_m * droplets->optics->extinction_per_m[band];
	const double r = slab_spherical_albedo(droplets->slab, band, tau), t = 1 - r, ground = job->ground.mean[band];
	return r + t * t * ground / (1 - r * ground);
}

/* What the air above gets back from below: the ground where it lies open, under clouds the deck and the ground behind it with all light
 * between them. A deck counts with 0.6 of its largest thickness, about the mean of its field; a map by what it holds. */
static void mean_albedo(const struct frame_job *job, double albedo[3])
{
	for (int band = 0; band < 3; band++)
		albedo[band] = job->ground.mean[band];
	if (!job->droplets)
		return;
	const struct scene_clouds *clouds = &job->scene->clouds;
	const struct scene_map *map = clouds->map.map;
	for (int band = 0; band < 3; band++) {
		const double ground = job->ground.mean[band];
		if (!map)
			albedo[band] += clouds->coverage * (deck_albedo(job, band, 0.6 * clouds->thickness_m) - ground);
		for (int i = 0; map && i < SCENE_MAP_BINS; i++)
			albedo[band] += map->bins[i].share * (deck_albedo(job, band, map->bins[i].value * clouds->thickness_m) - ground);
	}
}

static bool run_sky(struct frame_job *job)
{
	double albedo[3];
	struct stage_context *context = &job->renderer->context;
	if (!ground_stage_run(&job->renderer->ground, context, job->scene, &job->ground))
		return false;
	mean_albedo(job, albedo);
	return sky_stage_run(&job->renderer->sky, context, job->scene, albedo, &job->sky);
}

static bool run_field(struct frame_job *job)
{
	return field_stage_run(&job->renderer->field, &job->renderer->context, job->scene, field_uses(job->scene), &job->maps);
}

static bool run_radiosity(struct frame_job *job)
{
	struct scene_block *block = &job->renderer->context.block;
	for (int band = 0; band < 3; band++)
		block->air_below[band] = 1, block->air_around[band] = 0;
	job->clouds = job->maps.coarse != NULL;
	if (!job->clouds)
		job->renderer->context.reused = false; /* it does not run at all */
	return !job->clouds || radiosity_stage_run(&job->renderer->radiosity, &job->renderer->context, job->scene, &job->ground, &job->sky,
						   &job->maps, job->slab_rows, &job->light);
}

static struct scene_light scene_light_of(const struct frame_job *job)
{
	const double mu = fmax(0, sin(job->scene->sun.elevation_deg * M_PI / 180));
	const bool below = job->clouds && job->scene->camera.position_m[2] < job->scene->clouds.base_m;
	const bool high = job->scene->camera.position_m[2] >= job->scene->clouds.base_m;
	const float *beam = job->renderer->context.block.sun_at_camera;
	double direct[3], diffuse[3];
	for (int band = 0; band < 3; band++) {
		direct[band] = below ? job->light.ground_direct[band] : mu * beam[band];
		diffuse[band] = below ? job->light.ground_diffuse[band] : (high ? job->sky.diffuse_cloud : job->sky.diffuse_ground)[band];
	}
	return (struct scene_light){
		.direct = colour_luminance(direct), .diffuse = colour_luminance(diffuse), .beam = colour_luminance(job->sky.sun_cloud)};
}

/* For files of scene light alone: nothing else can hold the figures. */
static bool measure_illuminance(struct frame_job *job, const struct view_inputs *inputs)
{
	struct illuminance light;
	if (job->scene->output.format == IMAGE_PNG)
		return true;
	if (!illuminance_stage_run(&job->renderer->illuminance, &job->renderer->context, job->scene, inputs, &light))
		return false;
	job->frame->direct_illuminance_lux = colour_luminance(light.direct);
	job->frame->diffuse_illuminance_lux = colour_luminance(light.diffuse);
	job->frame->global_illuminance_lux = job->frame->direct_illuminance_lux + job->frame->diffuse_illuminance_lux;
	return true;
}

static int list_layers(const struct scene *scene, enum layer *layers)
{
	int count = 0;
	if (scene->output.format == IMAGE_PNG) {
		layers[count++] = LAYER_COLOR;
		return count;
	}
	for (int i = 0; i < LAYER_COUNT; i++)
		if (scene->output.layers & 1u << i)
			layers[count++] = (enum layer)i;
	return count;
}

/* What a sea mirrors is seen from its surface, whatever the camera's height. */
static bool run_sea(struct frame_job *job, struct view_inputs *inputs)
{
	struct stage_context *context = &job->renderer->context;
	const struct scene_block kept = context->block;
	struct scene low = *job->scene;
	struct sky_tables sky;
	struct view_inputs below = *inputs;
	double albedo[3];
	mean_albedo(job, albedo);
	low.camera.position_m[2] = sea_eye_m;
	context->block.camera_position[2] = (float)sea_eye_m;
	context->block.camera_position[3] = 0.03f; /* radians between its texels, about */
	below.sky = &sky;
	if (sky_stage_run(&job->renderer->sky, context, &low, albedo, &sky))
		inputs->sea_sky = sea_stage_run(&job->renderer->sea, context, &low, &below);
	context->block = kept;
	stage_upload_block(context);
	return inputs->sea_sky;
}

/* The clear sky as a path sees it that ends at some height. Leaves the block as it was. */
static const struct texture *sky_from(struct frame_job *job, double height)
{
	struct stage_context *context = &job->renderer->context;
	const struct scene_block kept = context->block;
	struct scene scene = *job->scene;
	struct sky_tables sky;
	double albedo[3];
	mean_albedo(job, albedo);
	scene.camera.position_m[2] = height;
	context->block.camera_position[2] = (float)height;
	const bool ok = sky_stage_run(&job->renderer->sky, context, &scene, albedo, &sky);
	context->block = kept;
	stage_upload_block(context);
	return ok ? sky.total : NULL;
}

/* Cancelled or not: what there is is a picture from here on. Without clouds the view stage's picture is the reference too. */
static bool run_reference(struct frame_job *job, const struct view_inputs *view)
{
	const struct scene *scene = job->scene;
	struct reference_result result;
	const struct reference_inputs inputs = {.view = view,
						.sky_at_layer = sky_from(job, scene->clouds.base_m + scene->clouds.thickness_m),
						.sky_at_ground = sky_from(job, 0.1)};
	const struct reference_watch watch = {job->cancelled, job->paused, job->cancel_context};
	struct render_pending *pending = *job->pending;
	if (!inputs.sky_at_layer || !inputs.sky_at_ground || !pending ||
	    !reference_stage_run(&job->renderer->reference, &job->renderer->context, scene, &inputs, job->frame->layer,
				 job->frame->layer_count, &watch, &pending->work, job->pictures, &result)) {
		job->unfinished = pending && pending->work && inputs.sky_at_layer && inputs.sky_at_ground;
		return false;
	}
	job->frame->samples = result.samples;
	job->frame->partial = result.stopped;
	if (result.stopped)
		job->cancelled = NULL;
	return true;
}

/* Of the output's size and codes, unless it is so already. */
static bool make_developed(struct texture *developed, const struct scene_output *output)
{
	const enum texture_format format = output->bits == 16 ? TEXTURE_RGBA16 : TEXTURE_RGBA8;
	if (developed->id && developed->width == output->width && developed->height == output->height && developed->format == format)
		return true;
	texture_finish(developed);
	return texture_init(developed, output->width, output->height, format, TEXTURE_NEAREST);
}

static bool run_view(struct frame_job *job)
{
	struct renderer *renderer = job->renderer;
	struct stage_context *context = &renderer->context;
	const struct scene_output *output = &job->scene->output;
	struct frame *frame = job->frame;
	struct view_inputs inputs = {.ground = &job->ground,
				     .droplets = job->droplets,
				     .slab_rows = job->slab_rows,
				     .slab_slices = job->slab_slices,
				     .sky = &job->sky,
				     .field = &job->maps,
				     .light = job->clouds ? &job->light : NULL};
	const struct scene_light light = scene_light_of(job);
	frame->exposure_ev = exposure_ev(job->scene, &light);
	context->block.develop[0] = output->exposure_auto;
	context->block.develop[1] = (float)frame->exposure_ev;
	context->block.develop[2] = output->tone;
	context->block.develop[3] = output->bits == 16 ? 65535 : 255;
	stage_upload_block(context);
	inputs.sun_cover = sun_cover_stage_run(&renderer->sun_cover, context, job->scene, &job->maps,
					       job->clouds && job->scene->camera.position_m[2] < job->scene->clouds.base_m);
	if (!inputs.sun_cover || !measure_illuminance(job, &inputs))
		return false;
	frame->layer_count = list_layers(job->scene, frame->layer);
	if (job->scene->ground.type == GROUND_SEA && !run_sea(job, &inputs))
		return false;
	const bool reference = job->scene->model.name == MODEL_REFERENCE && job->clouds;
	if (job->scene->model.name == MODEL_REFERENCE)
		frame->samples = job->scene->model.samples;
	if (reference ? !run_reference(job, &inputs)
		      : !view_stage_run(&renderer->view, context, job->scene, &inputs, frame->layer, frame->layer_count, job->cancelled,
					job->cancel_context, job->pictures))
		return false;
	if (output->format != IMAGE_PNG)
		return true;
	if (!make_developed(&renderer->developed, output))
		return false;
	view_develop(&renderer->view, job->pictures[0], job->scene->camera.projection == PROJECTION_FISHEYE, &renderer->developed);
	return true;
}

static bool run_readback(struct frame_job *job)
{
	struct frame *frame = job->frame;
	const struct scene_output *output = &job->scene->output;
	const struct texture *developed = &job->renderer->developed;
	frame->width = output->width;
	frame->height = output->height;
	frame->channels = 3;
	frame->type = output->format != IMAGE_PNG ? PIXEL_F32 : output->bits == 16 ? PIXEL_U16 : PIXEL_U8;
	return transfers_read(&job->renderer->transfers, frame, output->format == IMAGE_PNG ? &developed : job->pictures);
}

static bool (*const stage_functions[STAGE_COUNT])(struct frame_job *job) = {
	[STAGE_OPTICS] = run_optics,       [STAGE_SKY] = run_sky,   [STAGE_FIELD] = run_field,
	[STAGE_RADIOSITY] = run_radiosity, [STAGE_VIEW] = run_view, [STAGE_READBACK] = run_readback,
};

bool frame_job_run(struct frame_job *job, enum stage stage)
{
	return stage_functions[stage](job);
}
