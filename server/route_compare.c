/* /v1/compare: variants of a scene held against one of them.
 *
 * The HTTP thread reads and checks everything; then the request is suspended, and its variants are rendered one after another, each a job
 * of the render queue like any other, so that other pictures come in between. The last one's end starts the comparison on a worker.
 */
#include "server/routes.h"

#include "renderer/image/regions.h"
#include "renderer/log.h"
#include "server/access.h"
#include "server/admission.h"
#include "server/call.h"
#include "server/clock.h"
#include "server/compare_query.h"
#include "server/comparison.h"
#include "server/json_document.h"
#include "server/negotiation.h"
#include "server/reference_limits.h"
#include "server/response.h"
#include "server/scene_assets.h"
#include "server/service.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum compare_form { FORM_JSON, FORM_PNG, FORM_EXR };
static const char *const form_types[] = {"application/json", "image/png", "image/x-exr", NULL};

/* The variants, and the slab's layers of the truth. */
enum { RUNS_MAX = COMPARE_VARIANTS_MAX + 1, MASK_RUN = COMPARE_VARIANTS_MAX };

struct compare_run {
	struct render_job job;
	struct work decode;
	struct compare_work *work;
	struct scene *scene;
	struct scene_assets assets;
	double decoding_since_ms, decode_ms[SCENE_ASSETS_COUNT];
};

struct compare_work {
	struct work compare;
	struct request *request;
	struct promise promise;
	struct compare_query query;
	enum compare_form form;
	struct scene mask_scene;
	struct compare_run run[RUNS_MAX];
	int order[RUNS_MAX], run_count; /* indices of runs as they are rendered */
	int done;                       /* so many of them */
	double deadline_ms;
	bool refused;             /* too much waits */
	struct render_job *ended; /* the last, or the one that failed; its outcome is that of the whole */
	struct timings spent;     /* by comparing and encoding */
	struct image_buffer answer;
};

static void work_destroy(void *context)
{
	struct compare_work *work = context;
	admission_leave(work->request->service, &work->promise, false);
	for (int i = 0; i < RUNS_MAX; i++) {
		frame_finish(&work->run[i].job.frame);
		if (work->run[i].scene)
			scene_assets_finish(work->run[i].scene, &work->run[i].assets);
	}
	free(work->answer.data);
	free(work);
}

/* --- reading, on the HTTP thread ------------------------------------------------------------------------------------------- */

static void init_run(struct compare_work *work, int index, struct scene *scene)
{
	work->run[index].work = work;
	work->run[index].scene = scene;
	scene_assets_init(&work->run[index].assets);
}

static void check_variants(struct compare_work *work, const json_t *root)
{
	struct request *request = work->request;
	for (int i = 0; i < work->query.variant_count; i++) {
		struct problem own = {0};
		init_run(work, i, &work->query.variant[i].input.scene);
		reference_limits_check(request->service->config, work->run[i].scene, &own);
		admission_check_size(request->service->config, work->run[i].scene, "/output", &own);
		scene_assets_find(request->service->assets, work->run[i].scene, &work->run[i].assets, &own);
		compare_query_add(root, i, &own, &request->problem);
		problem_finish(&own);
	}
}

static void read_json(struct compare_work *work)
{
	struct request *request = work->request;
	json_t *root = json_document_parse(request->body.data, request->body.length, &request->problem);
	if (!root)
		return;
	compare_query_read(root, &work->query, &request->problem);
	if (request->problem.kind == PROBLEM_NONE)
		check_variants(work, root);
	json_decref(root);
}

static void read_body(struct request *request, struct compare_work *work)
{
	const int form = negotiation_choose_type(request_header(request, "Accept"), form_types);
	text_append(&request->body, "", 0);
	if (request->query && *request->query)
		problem_set(&request->problem, PROBLEM_BAD_REQUEST,
			    "A comparison is asked for by the body, so its address takes no query.");
	else if (request->body.failed)
		problem_set(&request->problem, PROBLEM_INTERNAL, "Out of memory.");
	else if (form < 0)
		problem_set(&request->problem, PROBLEM_NOT_ACCEPTABLE,
			    "A comparison is application/json, image/png or image/x-exr, which the Accept header excludes.");
	else
		read_json(work);
	work->form = (enum compare_form)form;
}

/* The slab's pictures first: when time runs out, a reference can stop early and they cannot. */
static void plan(struct compare_work *work)
{
	const struct compare_query *query = &work->query;
	if (query->has_masks) {
		work->mask_scene = compare_query_mask(query);
		init_run(work, MASK_RUN, &work->mask_scene);
		scene_assets_find(work->request->service->assets, &work->mask_scene, &work->run[MASK_RUN].assets, &work->request->problem);
		work->order[work->run_count++] = MASK_RUN;
	}
	for (int reference = 0; reference < 2; reference++)
		for (int i = 0; i < query->variant_count; i++)
			if ((query->variant[i].input.scene.model.name == MODEL_REFERENCE) == reference)
				work->order[work->run_count++] = i;
}

/* --- answering, on the HTTP thread ------------------------------------------------------------------------------------------ */

static enum MHD_Result send_answer(struct request *request)
{
	struct compare_work *work = request->work;
	timings_add_frame(&request->timings, &work->spent);
	struct MHD_Response *response = response_create(request, (char *)work->answer.data, work->answer.size);
	work->answer.data = NULL;
	response_set(response, "Content-Type", form_types[work->form]);
	response_set(response, "Vary", "Accept");
	response_set(response, "Cache-Control", CACHE_NONE);
	enum MHD_Result result = response_send(request, MHD_HTTP_OK, response);
	timings_set(&work->spent, TIMING_TOTAL, request->timings.entry[TIMING_TOTAL].milliseconds);
	metrics_count_timings(request->service->metrics, &work->spent);
	return result;
}

static enum MHD_Result finish(struct request *request)
{
	struct compare_work *work = request->work;
	if (work->refused)
		return call_refuse_render(request, work->ended ? work->ended : &work->run[work->order[0]].job);
	if (work->ended->outcome != RENDER_OUTCOME_OK)
		return call_send_render_failure(request, work->ended->outcome, "The comparison", "pictures of this size");
	return send_answer(request);
}

/* --- on other threads --------------------------------------------------------------------------------------------------------- */

static void hand_back(struct compare_work *work)
{
	admission_leave(work->request->service, &work->promise, work->ended->outcome == RENDER_OUTCOME_OK);
	call_end_render(work->request, work->ended);
}

static void refuse(struct compare_work *work)
{
	work->refused = true;
	admission_leave(work->request->service, &work->promise, false);
	request_resume(work->request);
}

static bool job_is_abandoned(struct render_job *job)
{
	return call_is_abandoned(((const struct compare_run *)((char *)job - offsetof(struct compare_run, job)))->work->request);
}

static bool job_is_over(void *context)
{
	return render_job_is_over(context);
}

static bool encode(struct compare_work *work, const struct comparison *comparison)
{
	const struct image_api *images = work->request->service->images;
	const struct image_watch watch = {job_is_over, work->ended};
	char error[256] = "out of memory";
	char *json = comparison_to_json(comparison);
	bool ok = json != NULL;
	if (ok && work->form == FORM_JSON) {
		work->answer = (struct image_buffer){(unsigned char *)json, strlen(json)};
		return true;
	}
	ok = ok && (work->form == FORM_PNG ? comparison_to_png : comparison_to_exr)(comparison, json, images, &watch, &work->answer, error,
										    sizeof error);
	if (!ok && !job_is_over(work->ended))
		log_error("request %s: encoding a comparison failed: %s", work->request->id, error);
	free(json);
	return ok;
}

static bool has_partial(const struct compare_work *work)
{
	bool partial = false;
	for (int i = 0; i < work->query.variant_count; i++)
		partial |= work->run[i].job.frame.partial;
	return partial;
}

static void compare(struct work *base)
{
	struct compare_work *work = (struct compare_work *)((char *)base - offsetof(struct compare_work, compare));
	const struct frame *frames[COMPARE_VARIANTS_MAX];
	struct comparison comparison;
	for (int i = 0; i < work->query.variant_count; i++)
		frames[i] = &work->run[i].job.frame;
	const double start = clock_now_ms();
	/* What was cut short for the deadline goes out, even if that passes now. */
	work->ended->deadline_ms = has_partial(work) ? INFINITY : work->deadline_ms;
	work->ended->phase = RENDER_PHASE_ENCODING;
	work->ended->outcome = RENDER_OUTCOME_NO_MEMORY; /* unless something else turns up */
	const bool ok = comparison_run(&work->query, frames, work->query.has_masks ? &work->run[MASK_RUN].job.frame : NULL, job_is_over,
				       work->ended, &comparison);
	const double compared = clock_now_ms();
	timings_set(&work->spent, TIMING_COMPARE, compared - start);
	if (ok && !job_is_over(work->ended)) {
		work->ended->outcome = RENDER_OUTCOME_FAILED;
		if (encode(work, &comparison))
			work->ended->outcome = RENDER_OUTCOME_OK;
		timings_set(&work->spent, TIMING_ENCODE, clock_now_ms() - compared);
	}
	if (work->ended->outcome == RENDER_OUTCOME_OK)
		job_is_over(work->ended);
	work->ended->encoded_ms = clock_now_ms() - start;
	comparison_finish(&comparison);
	for (int i = 0; i < RUNS_MAX; i++)
		frame_drop_pixels(&work->run[i].job.frame);
	admission_keep(work->request, work->answer.size);
	hand_back(work);
}

static bool start_run(struct compare_work *work);

/* The stages of each variant count by themselves, and their sums go into the answer. */
static void count_run(struct compare_run *run)
{
	struct request *request = run->work->request;
	struct timings own = {0};
	timings_set(&own, TIMING_QUEUE, run->job.waited_ms);
	timings_set_frame(&own, &run->job.frame);
	timings_add_optics(&own, run->job.prepared_ms, run->job.prepared);
	timings_add(&own, TIMING_FIELD, run->decode_ms[0]);
	timings_add(&own, TIMING_SKY, run->decode_ms[1]); /* the ground is part of it */
	metrics_count_timings(request->service->metrics, &own);
	timings_add_frame(&request->timings, &own);
}

static void on_rendered(struct render_job *job)
{
	struct compare_run *run = (struct compare_run *)((char *)job - offsetof(struct compare_run, job));
	struct compare_work *work = run->work;
	struct service *service = work->request->service;
	preparation_release(service->preparation, job);
	scene_assets_release(run->scene);
	work->ended = job;
	/* Here and now: several pictures of a comparison would fill the places between renderer and memory. */
	if (job->outcome == RENDER_OUTCOME_OK && !frame_take_pixels(&job->frame))
		job->outcome = RENDER_OUTCOME_NO_MEMORY;
	if (job->outcome == RENDER_OUTCOME_FAILED)
		log_error("request %s: rendering failed", work->request->id);
	if (job->outcome != RENDER_OUTCOME_OK) {
		hand_back(work);
		return;
	}
	count_run(run);
	const bool last = ++work->done == work->run_count;
	if (!(last ? worker_pool_try(service->computers, &work->compare) : start_run(work)))
		refuse(work);
}

/* The first run asks to be admitted; the others belong to a request that was. */
static bool push(struct compare_work *work, struct compare_run *run)
{
	if (work->done == 0)
		return preparation_push(work->request->service->preparation, &run->job);
	preparation_pass(work->request->service->preparation, &run->job);
	return true;
}

static struct compare_run *run_to_decode(struct work *base)
{
	return (struct compare_run *)((char *)base - offsetof(struct compare_run, decode));
}

static bool waits_in_vain(struct work *base)
{
	return render_job_is_over(&run_to_decode(base)->job);
}

static void decode(struct work *base)
{
	struct compare_run *run = run_to_decode(base);
	struct compare_work *work = run->work;
	struct service *service = work->request->service;
	run->job.waited_ms += clock_now_ms() - run->decoding_since_ms;
	run->job.outcome = RENDER_OUTCOME_FAILED;
	if (render_job_is_over(&run->job) || !scene_assets_decode(service->maps, service->decoder, run->scene, &run->assets, job_is_over,
								  &run->job, run->job.deadline_ms, run->decode_ms)) {
		work->ended = &run->job;
		hand_back(work);
	} else if (!push(work, run)) {
		refuse(work);
	}
}

/* What comparing takes on a slow processor, ms for each pixel of each variant. */
#define COMPARE_PIXEL_MS 2e-3

/* Those that may end early share the time that is left. They are the last, so that all after this one are such, or are not done in time
 * anyway. */
static double stop_ms(const struct compare_work *work, const struct scene *scene)
{
	const double now = clock_now_ms(), pixels = (double)scene->output.width * scene->output.height;
	const double stop = reference_stop_ms(scene, now, work->deadline_ms, COMPARE_PIXEL_MS * pixels * work->query.variant_count);
	return stop < work->deadline_ms ? now + (stop - now) / (work->run_count - work->done) : stop;
}

/* The next variant. It may be rendered, and more, before this returns. false when too much waits. */
static bool start_run(struct compare_work *work)
{
	struct compare_run *run = &work->run[work->order[work->done]];
	struct service *service = work->request->service;
	run->job.scene = run->scene;
	run->job.deadline_ms = stop_ms(work, run->scene);
	run->job.abandoned = job_is_abandoned;
	run->job.finished = on_rendered;
	run->decode.run = decode;
	run->decode.is_over = waits_in_vain;
	run->decode.client = work->request->client;
	admission_price(work->request, &run->job);
	run->decoding_since_ms = clock_now_ms();
	return scene_assets_take(service->maps, run->scene, &run->assets) ? push(work, run)
									  : worker_pool_try(service->decoders, &run->decode);
}

/* --- the way through ------------------------------------------------------------------------------------------------------------ */

static bool enter(struct compare_work *work)
{
	const struct scene *scenes[RUNS_MAX];
	for (int i = 0; i < work->run_count; i++)
		scenes[i] = work->run[work->order[i]].scene;
	return admission_enter(work->request, &work->promise, scenes, work->run_count, NULL, work->deadline_ms);
}

enum MHD_Result route_compare(struct request *request)
{
	struct compare_work *work = calloc(1, sizeof *work);
	if (!work)
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	work->request = request;
	work->compare.run = compare;
	work->compare.client = request->client;
	request->work = work;
	request->work_destroy = work_destroy;

	read_body(request, work);
	work->deadline_ms = request_read_deadline(request);
	if (request->problem.kind == PROBLEM_NONE)
		plan(work);
	if (request->problem.kind != PROBLEM_NONE || service_refuses(request))
		return response_send_problem(request);
	if (!enter(work))
		return response_send_problem(request);
	const struct scene_output *output = &work->query.variant[0].input.scene.output;
	enum MHD_Result result;
	if (!access_admit_pixels(request, (double)output->width * output->height * work->query.variant_count, &result))
		return result;
	/* Suspended first: a picture may be done before start_run returns. */
	request_suspend(request, finish);
	if (!start_run(work))
		refuse(work);
	return MHD_YES;
}
