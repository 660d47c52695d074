#include "renderer/renderer.h"

#include "renderer/frame_job.h"
#include "renderer/gl/memory.h"
#include "renderer/log.h"

#include <epoxy/gl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const stage_names[STAGE_COUNT] = {"optics", "sky", "field", "radiosity", "view", "readback"};

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
	/* Pictures are large and seldom asked for twice; memory of one that was dropped is cheaper for the next than fresh memory, which
	 * software renderers clear. */
	cache_bound_owner(renderer->context.cache, STAGE_VIEW, (params->cache_bytes ? params->cache_bytes : DEFAULT_CACHE_BYTES) / 4);
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
		texture_finish(&renderer->developed);
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

/* What went on before, in the same picture. */
static void add_spent(struct frame_job *job)
{
	const struct render_pending *pending = *job->pending;
	for (int i = 0; pending && i < STAGE_COUNT; i++) {
		job->frame->timing[i].milliseconds += pending->spent[i].milliseconds;
		job->frame->timing[i].reused &= pending->spent[i].reused;
	}
}

/* Is there a picture already, that is wanted even when it is cancelled? */
static bool has_samples(const struct frame_job *job)
{
	const struct render_pending *pending = *job->pending;
	return pending && pending->work && job->scene->model.partial && reference_work_samples(pending->work) > 0;
}

static bool is_cancelled(const struct frame_job *job)
{
	return job->cancelled && !has_samples(job) && job->cancelled(job->cancel_context);
}

/* Those of another picture do not count. */
static void forget_faults(void)
{
	pass_was_refused();
	pass_lacked_texture();
	gl_failed_otherwise();
}

/* Of a stage that could not do its work. */
static enum render_result result_of_fault(void)
{
	const bool no_program = pass_was_refused(), failed = gl_failed_otherwise();
	return gl_lost() ? RENDER_FAILED : no_program ? RENDER_NO_PROGRAM : failed ? RENDER_FAILED : RENDER_OUT_OF_MEMORY;
}

static enum render_result result_of_failure(const struct frame_job *job)
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

static enum render_result run_stages(struct frame_job *job)
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
		const bool ok = frame_job_run(job, (enum stage)i);
		gl_timer_end(&renderer->timers[i]);
		if (i != STAGE_READBACK)
			timing->milliseconds = clock_milliseconds() - begin;
		timing->reused = renderer->context.reused;
		if (!ok)
			return result_of_failure(job);
		if (pass_lacked_texture())
			return RENDER_FAILED;
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
static void settle_pending(struct frame_job *job, enum render_result result)
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
	struct frame_job job = {.renderer = renderer,
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
