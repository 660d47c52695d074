#include "renderer/renderer.h"

#include "renderer/frame_transfer.h"
#include "renderer/gl/context.h"
#include "renderer/gl/memory.h"
#include "renderer/gl/timer.h"
#include "renderer/log.h"
#include "renderer/scene_map.h"
#include "renderer/stages/colour.h"
#include "renderer/stages/ground.h"
#include "renderer/stages/illuminance.h"
#include "renderer/stages/reference.h"
#include "renderer/stages/sun_cover.h"
#include "renderer/stages/sea.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const stage_names[STAGE_COUNT] = {"optics", "sky", "field", "radiosity", "view", "readback"};

struct renderer {
	struct gl_context *gl;
	struct renderer_info info;
	struct stage_context context;
	struct ground_stage ground;
	struct sky_stage sky;
	struct field_stage field;
	struct radiosity_stage radiosity;
	struct view_stage view;
	struct reference_stage reference;
	struct illuminance_stage illuminance;
	struct sun_cover_stage sun_cover;
	struct sea_stage sea;
	struct gl_timer timers[STAGE_COUNT];
	struct frame_transfers transfers;
};

enum { DEFAULT_CACHE_BYTES = 256 << 20 };

/* --- life ------------------------------------------------------------------------------------------------------------------------ */

static bool compile_stages(struct renderer *renderer, const struct pass_compiler *compiler)
{
	ground_stage_init(&renderer->ground, compiler);
	sea_stage_init(&renderer->sea, compiler);
	reference_stage_init(&renderer->reference, compiler);
	illuminance_stage_init(&renderer->illuminance, compiler);
	sun_cover_stage_init(&renderer->sun_cover, compiler);
	return sky_stage_init(&renderer->sky, compiler) && field_stage_init(&renderer->field, compiler) &&
	       radiosity_stage_init(&renderer->radiosity, compiler) && view_stage_init(&renderer->view, compiler);
}

static void finish_stages(struct renderer *renderer)
{
	sun_cover_stage_finish(&renderer->sun_cover);
	illuminance_stage_finish(&renderer->illuminance);
	sea_stage_finish(&renderer->sea);
	reference_stage_finish(&renderer->reference);
	view_stage_finish(&renderer->view);
	radiosity_stage_finish(&renderer->radiosity);
	field_stage_finish(&renderer->field);
	sky_stage_finish(&renderer->sky);
	ground_stage_finish(&renderer->ground);
}

/* Small scene that exercises every pass, for measuring and for having every shader built before the first request. */
static bool warm_up(struct renderer *renderer, double *milliseconds)
{
	struct scene scene = scene_default();
	struct frame frame;
	scene.output.width = scene.output.height = 256;
	double best = 1e9;
	for (int i = 0; i < 3; i++) {
		scene.camera.azimuth_deg = scene.sun.azimuth_deg + 10.0 * i; /* else the picture would be remembered; with the sun in it */
		const double begin = clock_milliseconds();
		if (renderer_render(renderer, &scene, NULL, NULL, &frame) != RENDER_OK)
			return false;
		best = fmin(best, clock_milliseconds() - begin);
		frame_finish(&frame);
	}
	*milliseconds = best;
	return true;
}

/* Fragment or compute: software Mesa runs fragments faster, some data-centre parts compute; both ways of one text, so the faster is taken.
 */
static bool choose_pass_kind(struct renderer *renderer, const struct renderer_params *params)
{
	double fragment, compute;
	struct pass_compiler compiler = {.kind = PASS_FRAGMENT, .software = renderer->info.software, .shader_dir = params->shader_dir};
	if (!compile_stages(renderer, &compiler) || !warm_up(renderer, &fragment))
		return false;
	renderer->info.pass_kind = PASS_FRAGMENT;
	if (renderer->info.software)
		return true; /* known, and measuring would double the time to start */
	finish_stages(renderer);
	compiler.kind = PASS_COMPUTE;
	if (!compile_stages(renderer, &compiler) || !warm_up(renderer, &compute))
		return false;
	log_info("renderer: %.2f ms a picture in fragment, %.2f ms in compute programs", fragment, compute);
	renderer->info.pass_kind = PASS_COMPUTE;
	if (compute <= fragment)
		return true;
	finish_stages(renderer);
	compiler.kind = renderer->info.pass_kind = PASS_FRAGMENT;
	return compile_stages(renderer, &compiler);
}

static bool start_stages(struct renderer *renderer, const struct renderer_params *params)
{
	double milliseconds;
	const struct pass_compiler compiler = {
		.kind = params->pass_kind, .software = renderer->info.software, .shader_dir = params->shader_dir};
	if (params->pass_kind == PASS_AUTO)
		return choose_pass_kind(renderer, params);
	renderer->info.pass_kind = params->pass_kind;
	return compile_stages(renderer, &compiler) && warm_up(renderer, &milliseconds);
}

struct renderer *renderer_create(const struct renderer_params *params)
{
	struct renderer *renderer = calloc(1, sizeof *renderer);
	if (!renderer)
		return NULL;
	renderer->gl = gl_context_create(params->device_index, params->require_gpu);
	if (!renderer->gl)
		goto fail;
	const struct gl_context_info *gl = gl_context_info(renderer->gl);
	renderer->info = (struct renderer_info){.vendor = gl->vendor,
						.renderer = gl->renderer,
						.version = gl->version,
						.platform = gl->platform,
						.software = gl->software,
						.max_texture_size = gl->max_texture_size};
	renderer->context.droplets = params->droplets;
	renderer->context.cache = cache_create(params->cache_bytes ? params->cache_bytes : DEFAULT_CACHE_BYTES);
	if (!renderer->context.cache)
		goto fail;
	glCreateBuffers(1, &renderer->context.block_buffer);
	glNamedBufferStorage(renderer->context.block_buffer, sizeof renderer->context.block, NULL, GL_DYNAMIC_STORAGE_BIT);
	if (!start_stages(renderer, params)) {
		log_error("renderer: cannot start");
		goto fail;
	}
	return renderer;

fail:
	renderer_destroy(renderer);
	return NULL;
}

void renderer_destroy(struct renderer *renderer)
{
	if (!renderer)
		return;
	if (renderer->gl) {
		for (int i = 0; i < STAGE_COUNT; i++)
			gl_timer_finish(&renderer->timers[i]);
		transfers_finish(&renderer->transfers);
		cache_destroy(renderer->context.cache); /* first: what it drops may go back to a stage */
		finish_stages(renderer);
		if (renderer->context.block_buffer)
			glDeleteBuffers(1, &renderer->context.block_buffer);
		gl_context_destroy(renderer->gl);
	}
	free(renderer);
}

const struct renderer_info *renderer_info(const struct renderer *renderer)
{
	return &renderer->info;
}

_Static_assert((int)STAGE_COUNT <= (int)CACHE_OWNERS, "every stage owns results");

size_t renderer_cache_bytes(const struct renderer *renderer, enum stage stage)
{
	return cache_owned_bytes(renderer->context.cache, stage);
}

/* --- one frame -------------------------------------------------------------------------------------------------------------------- */

/* What a reference keeps from one call to the next. */
struct render_pending {
	struct reference_work *work;
	struct stage_timing spent[STAGE_COUNT];
};

/* Work of one call of renderer_render. */
struct job {
	struct renderer *renderer;
	const struct scene *scene;
	renderer_cancelled *cancelled, *paused;
	void *cancel_context;
	struct render_pending **pending;
	bool unfinished; /* the rest is for another call */
	struct frame *frame;

	struct ground_maps ground;
	const struct droplets *droplets;
	const struct texture *slab_rows, *slab_slices;
	struct sky_tables sky;
	struct field_maps maps;
	struct radiosity_light light;
	bool clouds;
	const struct texture *pictures[LAYER_COUNT];
	struct texture developed;
};

static bool run_optics(struct job *job)
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
static double deck_albedo(const struct job *job, int band, double thickness_m)
{
	const struct droplet_tables *droplets = job->droplets->tables;
	const double tau = thickness_m * droplets->optics->extinction_per_m[band];
	const double r = slab_spherical_albedo(droplets->slab, band, tau), t = 1 - r, ground = job->ground.mean[band];
	return r + t * t * ground / (1 - r * ground);
}

/* What the air above gets back from below: the ground where it lies open, under clouds the deck and the ground behind it with all light
 * between them. A deck counts with 0.6 of its largest thickness, about the mean of its field; a map by what it holds. */
static void mean_albedo(const struct job *job, double albedo[3])
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

static bool run_sky(struct job *job)
{
	double albedo[3];
	struct stage_context *context = &job->renderer->context;
	if (!ground_stage_run(&job->renderer->ground, context, job->scene, &job->ground))
		return false;
	mean_albedo(job, albedo);
	return sky_stage_run(&job->renderer->sky, context, job->scene, albedo, &job->sky);
}

static bool run_field(struct job *job)
{
	const bool above = job->scene->camera.position_m[2] >= job->scene->clouds.base_m;
	return field_stage_run(&job->renderer->field, &job->renderer->context, job->scene, above, &job->maps);
}

static bool run_radiosity(struct job *job)
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

/* What counts for the automatic exposure: mean horizontal illuminances over the tile, direct and diffuse, and of the beam on a plane normal
 * to it, above the clouds; lux. Not those at the camera, since a picture must not brighten when a cloud passes before the sun. */
struct scene_light {
	double direct, diffuse, beam;
};

static struct scene_light scene_light_of(const struct job *job)
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

/* From above a layer is looked at that sends back half to three quarters of what it gets: as snow in the sun is, it is exposed for more
 * than a grey mean, so that it comes out white. As far as the sun lights it. */
static const double exposure_above_ev = 0.25;

/* The sky that a low sun shines through is far brighter on its side than all round: as much of the beam counts as that does, and as clouds
 * let through. */
static double low_sun_share(const struct job *job, const struct scene_light *light)
{
	const double elevation = job->scene->sun.elevation_deg, mu = sin(elevation * M_PI / 180);
	const double passed = mu > 0 ? fmin(light->direct / (mu * light->beam + 1e-9), 1) : 0;
	return 0.2 * exp(-pow(elevation / 8, 2)) * passed;
}

/* Automatic exposure from the scene's light alone, never from the picture. What counts is what a picture of the sky shows: diffuse light
 * most of all, sunlight on the ground by a fifth, and a little of the beam itself, which a low sun sends along the ground into the sky that
 * is looked at. A white sheet in that light comes out at 0.6 before tone, and full sunlight as a camera has it at 1/100 s, f/16 and ISO
 * 100; most of a change of light is followed, as an eye does, but not all, so that dusk stays darker than noon. */
static double exposure_of(const struct job *job)
{
	if (!job->scene->output.exposure_auto)
		return job->scene->output.exposure_ev;
	const bool above = scene_has_clouds(job->scene) && job->scene->camera.position_m[2] >= job->scene->clouds.base_m;
	const struct scene_light light = scene_light_of(job);
	const double lux = fmax(0.65 * light.diffuse + 0.21 * light.direct + (0.08 + low_sun_share(job, &light)) * light.beam, 1e-2);
	return log2(0.6 * M_PI * COLOUR_WHITE_LUMINANCE / lux) + 0.18 * log2(lux / 40000) +
	       (above ? exposure_above_ev * light.direct / (light.direct + light.diffuse + 1e-9) : 0);
}

/* For files of scene light alone: nothing else can hold the figures. */
static bool measure_illuminance(struct job *job, const struct view_inputs *inputs)
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
static bool run_sea(struct job *job, struct view_inputs *inputs)
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
static const struct texture *sky_from(struct job *job, double height)
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
static bool run_reference(struct job *job, const struct view_inputs *view)
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

static bool run_view(struct job *job)
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
	frame->exposure_ev = exposure_of(job);
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
	if (!texture_init(&job->developed, output->width, output->height, output->bits == 16 ? TEXTURE_RGBA16 : TEXTURE_RGBA8,
			  TEXTURE_NEAREST))
		return false;
	view_develop(&renderer->view, job->pictures[0], job->scene->camera.projection == PROJECTION_FISHEYE, &job->developed);
	return true;
}

static bool run_readback(struct job *job)
{
	struct frame *frame = job->frame;
	const struct scene_output *output = &job->scene->output;
	const struct texture *developed = &job->developed;
	frame->width = output->width;
	frame->height = output->height;
	frame->channels = 3;
	frame->type = output->format != IMAGE_PNG ? PIXEL_F32 : output->bits == 16 ? PIXEL_U16 : PIXEL_U8;
	return transfers_read(&job->renderer->transfers, frame, output->format == IMAGE_PNG ? &developed : job->pictures);
}

static bool (*const stage_functions[STAGE_COUNT])(struct job *job) = {
	[STAGE_OPTICS] = run_optics,       [STAGE_SKY] = run_sky,   [STAGE_FIELD] = run_field,
	[STAGE_RADIOSITY] = run_radiosity, [STAGE_VIEW] = run_view, [STAGE_READBACK] = run_readback,
};

/* What went on before, in the same picture. */
static void add_spent(struct job *job)
{
	const struct render_pending *pending = *job->pending;
	for (int i = 0; pending && i < STAGE_COUNT; i++) {
		job->frame->timing[i].milliseconds += pending->spent[i].milliseconds;
		job->frame->timing[i].reused &= pending->spent[i].reused;
	}
}

/* Is there a picture already, that is wanted even when it is cancelled? */
static bool has_samples(const struct job *job)
{
	const struct render_pending *pending = *job->pending;
	return pending && pending->work && job->scene->model.partial && reference_work_samples(pending->work) > 0;
}

static bool is_cancelled(const struct job *job)
{
	return job->cancelled && !has_samples(job) && job->cancelled(job->cancel_context);
}

/* Those of another picture do not count. */
static void forget_faults(void)
{
	pass_was_refused();
	gl_failed_otherwise();
}

/* Of a stage that could not do its work. */
static enum render_result result_of_fault(void)
{
	const bool no_program = pass_was_refused(), failed = gl_failed_otherwise();
	return gl_lost() ? RENDER_FAILED : no_program ? RENDER_NO_PROGRAM : failed ? RENDER_FAILED : RENDER_OUT_OF_MEMORY;
}

static enum render_result result_of_failure(const struct job *job)
{
	if (job->unfinished)
		return RENDER_UNFINISHED;
	if (job->renderer->context.stopped || (job->cancelled && job->cancelled(job->cancel_context)))
		return RENDER_CANCELLED;
	return result_of_fault();
}

static bool job_is_cancelled(void *context)
{
	return is_cancelled(context);
}

/* Whom the stages ask between their passes; NULL: nobody. */
static void set_cancelled(struct renderer *renderer, renderer_cancelled *cancelled, void *context)
{
	renderer->context.cancelled = cancelled;
	renderer->context.cancel_context = context;
	renderer->context.stopped = false;
}

static enum render_result run_stages(struct job *job)
{
	struct renderer *renderer = job->renderer;
	for (int i = 0; i < STAGE_COUNT; i++) {
		struct stage_timing *timing = &job->frame->timing[i];
		if (is_cancelled(job))
			return RENDER_CANCELLED;
		const double begin = clock_milliseconds();
		renderer->context.reused = i != STAGE_READBACK;
		cache_set_owner(renderer->context.cache, i);
		gl_timer_begin(&renderer->timers[i]);
		const bool ok = stage_functions[i](job);
		gl_timer_end(&renderer->timers[i]);
		if (i != STAGE_READBACK)
			timing->milliseconds = clock_milliseconds() - begin;
		timing->reused = renderer->context.reused;
		if (!ok)
			return result_of_failure(job);
		if (gl_failed(stage_names[i]))
			return gl_failed_for_memory() ? RENDER_OUT_OF_MEMORY : RENDER_FAILED;
	}
	transfers_depart(job->frame, renderer->timers);
	return RENDER_OK;
}

void renderer_drop_pending(struct render_pending **pending)
{
	if (*pending)
		reference_work_destroy((*pending)->work);
	free(*pending);
	*pending = NULL;
}

/* Keeps what a picture that goes on took so far; frees what another one left. */
static void settle_pending(struct job *job, enum render_result result)
{
	if (result == RENDER_UNFINISHED)
		memcpy((*job->pending)->spent, job->frame->timing, sizeof job->frame->timing);
	else
		renderer_drop_pending(job->pending);
}

enum render_result renderer_render(struct renderer *renderer, const struct scene *scene, renderer_cancelled *cancelled, void *context,
				   struct frame *frame)
{
	struct render_pending *pending = NULL;
	return renderer_render_some(renderer, scene, cancelled, NULL, context, &pending, frame);
}

enum render_result renderer_render_some(struct renderer *renderer, const struct scene *scene, renderer_cancelled *cancelled,
					renderer_cancelled *paused, void *context, struct render_pending **pending, struct frame *frame)
{
	enum render_result result = renderer_start(renderer, scene, cancelled, paused, context, pending, frame);
	if (result != RENDER_OK)
		return result;
	while ((result = renderer_arrive(renderer, frame, 1000)) == RENDER_UNFINISHED)
		;
	if (result == RENDER_OK && !frame_take_pixels(frame)) {
		frame_finish(frame);
		return RENDER_OUT_OF_MEMORY;
	}
	return result;
}

enum render_result renderer_start(struct renderer *renderer, const struct scene *scene, renderer_cancelled *cancelled,
				  renderer_cancelled *paused, void *context, struct render_pending **pending, struct frame *frame)
{
	*frame = (struct frame){0};
	struct job job = {.renderer = renderer,
			  .scene = scene,
			  .cancelled = cancelled,
			  .paused = paused,
			  .cancel_context = context,
			  .pending = pending,
			  .frame = frame};
	if (!*pending && scene->model.name == MODEL_REFERENCE)
		*pending = calloc(1, sizeof **pending);
	if (scene->output.width > renderer->info.max_texture_size || scene->output.height > renderer->info.max_texture_size) {
		log_error("renderer: %d x %d is more than this device's %d", scene->output.width, scene->output.height,
			  renderer->info.max_texture_size);
		renderer_drop_pending(pending);
		return RENDER_OUT_OF_MEMORY;
	}
	forget_faults();
	cache_begin_frame(renderer->context.cache);
	memset(&renderer->context.block, 0, sizeof renderer->context.block);
	view_fill_block(&renderer->context.block, scene);
	sea_fill_block(&renderer->context.block, scene);
	/* The sky is tabulated up to the layer, so its heights are known before the field is. */
	renderer->context.block.cloud_layer[0] = (float)scene->clouds.base_m;
	renderer->context.block.cloud_layer[1] = (float)scene->clouds.thickness_m;
	renderer->context.block.cloud_layer[3] = scene->clouds.type != CLOUD_NONE && scene->clouds.thickness_m > 0;

	set_cancelled(renderer, cancelled ? job_is_cancelled : NULL, &job);
	const enum render_result result = run_stages(&job);
	set_cancelled(renderer, NULL, NULL);
	add_spent(&job);
	settle_pending(&job, result);
	frame->radiosity_passes = job.light.passes;
	frame->radiosity_residual = job.light.residual;
	memcpy(frame->radiosity_residuals, job.light.residuals, sizeof frame->radiosity_residuals);
	texture_finish(&job.developed);
	droplets_release(&renderer->context);
	if (result != RENDER_OK) {
		if (result == RENDER_OUT_OF_MEMORY)
			log_error("renderer: out of memory");
		frame_finish(frame);
	}
	return result;
}

/* --- the device ------------------------------------------------------------------------------------------------------------------- */

_Static_assert((int)RENDERER_LOST_GUILTY == (int)GL_LOST_GUILTY && (int)RENDERER_LOST_UNKNOWN == (int)GL_LOST_UNKNOWN, "one list");

enum renderer_loss renderer_look(void)
{
	gl_was_reset("looked for");
	return (enum renderer_loss)gl_lost();
}

double renderer_free_memory(void)
{
	return gl_free_memory();
}

/* --- the sky alone ----------------------------------------------------------------------------------------------------------------- */

static enum render_result run_sky_light(struct renderer *renderer, const struct scene *scene, const struct sky_directions *directions,
					struct sky_light *light)
{
	struct stage_context *context = &renderer->context;
	struct ground_maps ground;
	const bool ok = ground_stage_run(&renderer->ground, context, scene, &ground) &&
			sky_stage_run_directions(&renderer->sky, context, scene, ground.mean, directions, light);
	if (gl_failed("sky light") && !gl_failed_for_memory())
		return RENDER_FAILED;
	return ok ? RENDER_OK : context->stopped ? RENDER_CANCELLED : result_of_fault();
}

enum render_result renderer_sky_light(struct renderer *renderer, const struct scene *scene, const struct sky_directions *directions,
				      renderer_cancelled *cancelled, void *context, struct sky_light *light)
{
	struct scene clear = *scene;
	clear.clouds.type = CLOUD_NONE;
	*light = (struct sky_light){0};
	if (cancelled && cancelled(context))
		return RENDER_CANCELLED;
	forget_faults();
	cache_begin_frame(renderer->context.cache);
	memset(&renderer->context.block, 0, sizeof renderer->context.block);
	view_fill_block(&renderer->context.block, &clear);
	renderer->context.reused = true;
	cache_set_owner(renderer->context.cache, STAGE_SKY);
	gl_timer_begin(&renderer->timers[STAGE_SKY]);
	set_cancelled(renderer, cancelled, context);
	enum render_result result = run_sky_light(renderer, &clear, directions, light);
	set_cancelled(renderer, NULL, NULL);
	gl_timer_end(&renderer->timers[STAGE_SKY]);
	light->timing = (struct stage_timing){gl_timer_milliseconds(&renderer->timers[STAGE_SKY]), false};
	if (result == RENDER_OK && cancelled && cancelled(context))
		result = RENDER_CANCELLED;
	if (result != RENDER_OK) {
		if (result == RENDER_OUT_OF_MEMORY)
			log_error("renderer: out of memory");
		free(light->radiance);
		*light = (struct sky_light){0};
	}
	return result;
}
