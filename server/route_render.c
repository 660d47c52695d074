/* /v1/render: a scene in, an image out.
 *
 * The HTTP thread reads and checks the scene and answers what needs no rendering; then the request is suspended and goes, past the threads
 * that decode its maps and prepare its droplets where they are new, from the queue to the render thread, from there to a worker that
 * encodes, and back to the HTTP thread with its image.
 */
#include "server/routes.h"

#include "renderer/log.h"
#include "server/access.h"
#include "server/admission.h"
#include "server/call.h"
#include "server/clock.h"
#include "server/cost_model.h"
#include "server/json_document.h"
#include "server/negotiation.h"
#include "server/query.h"
#include "server/reference_limits.h"
#include "server/response.h"
#include "server/scene_assets.h"
#include "server/scene_canonical.h"
#include "server/scene_json.h"
#include "server/scene_query.h"
#include "server/scene_rules.h"
#include "server/service.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct render_work {
	struct render_job job; /* for the render thread */
	struct work decode;    /* for the decoder, when a map is not in memory */
	struct work encode;    /* for the worker */
	struct request *request;
	struct scene_input input;
	struct scene_assets assets;
	double decoding_since_ms, decode_ms[SCENE_ASSETS_COUNT];
	char *canonical, *location;
	char key[DIGEST_SIZE], tag[ENTITY_TAG_SIZE];
	double deadline_ms;
	bool refused; /* the queue was full */
	struct image_buffer image;
	double encode_ms;
};

static void work_destroy(void *context)
{
	struct render_work *work = context;
	frame_finish(&work->job.frame);
	scene_assets_finish(&work->input.scene, &work->assets);
	free(work->image.data);
	free(work->canonical);
	free(work->location);
	free(work);
}

/* --- reading, on the HTTP thread ------------------------------------------------------------------------------------------- */

static void read_body(struct request *request, struct scene_input *input)
{
	text_append(&request->body, "", 0);
	if (request->body.failed) {
		problem_set(&request->problem, PROBLEM_INTERNAL, "Out of memory.");
		return;
	}
	json_t *root = json_document_parse(request->body.data, request->body.length, &request->problem);
	if (root)
		scene_json_read(root, input, &request->problem);
	json_decref(root);
}

static void read_query(struct request *request, struct scene_input *input)
{
	struct query query;
	if (query_parse(request->query, &query, &request->problem))
		scene_query_read(&query, NULL, input, &request->problem);
	query_finish(&query);
}

/* A scene comes in one place: what stands in the other would go unheard. */
static void refuse_the_other_place(struct request *request)
{
	if (request->is_post && request->query && *request->query)
		problem_set(&request->problem, PROBLEM_BAD_REQUEST, "The scene of a POST is its body, so its address takes no query.");
	if (!request->is_post && request->body.length > 0)
		problem_set(&request->problem, PROBLEM_BAD_REQUEST,
			    "The scene of a GET is its query, so it takes no body: send that by POST.");
}

/* Fills request->problem when there is no such picture to be had. */
static void read_scene(struct request *request, struct render_work *work)
{
	struct scene_input *input = &work->input;
	*input = scene_input_default();
	refuse_the_other_place(request);
	if (request->problem.kind != PROBLEM_NONE)
		return;
	if (request->is_post)
		read_body(request, input);
	else
		read_query(request, input);
	if (request->problem.kind != PROBLEM_NONE && request->problem.kind != PROBLEM_INVALID)
		return;
	enum image_format *format = &input->scene.output.format;
	bool acceptable = negotiation_choose(request_header(request, "Accept"), *format, format);
	scene_rules_apply(input, &request->problem);
	reference_limits_check(request->service->config, &input->scene, &request->problem);
	admission_check_size(request->service->config, &input->scene, "/output", &request->problem);
	scene_assets_find(request->service->assets, &input->scene, &work->assets, &request->problem);
	if (!acceptable)
		problem_set(&request->problem, PROBLEM_NOT_ACCEPTABLE, "The image would be %s, which the Accept header excludes.",
			    image_content_types[*format]);
}

/* What follows from the scene alone. false when out of memory. */
static bool describe(struct render_work *work, const struct service *service)
{
	struct text location = {0};
	char *query = scene_canonical_query(&work->input.scene);
	work->canonical = scene_canonical(&work->input.scene);
	scene_canonical_key(&work->input.scene, work->key);
	text_add(&location, "/v1/render");
	text_printf(&location, "%s%s", query && *query ? "?" : "", query ? query : "");
	work->location = text_take(&location);
	bool good = query && work->canonical && work->location && call_tag(service, "render", strdup(work->canonical), work->tag);
	if (work->canonical)
		digest_of(work->canonical, strlen(work->canonical), work->request->scene);
	free(query);
	return good;
}

/* --- answering, on the HTTP thread ------------------------------------------------------------------------------------------ */

static enum MHD_Result send_image(struct request *request, unsigned status, struct MHD_Response *response)
{
	const struct render_work *work = request->work;
	if (status == MHD_HTTP_OK)
		response_set(response, "Content-Type", image_content_types[work->input.scene.output.format]);
	/* The content of a map may change behind its name. */
	const bool named = *work->input.scene.clouds.map.name || *work->input.scene.ground.map.name;
	const bool timed = reference_is_timed(&work->input.scene);
	if (!timed)
		response_set(response, "ETag", work->tag);
	response_set(response, "Vary", "Accept");
	response_set(response, "Cache-Control", timed ? CACHE_NONE : named ? CACHE_ASK : CACHE_KEEP);
	response_set(response, "X-Scene-Key", work->key);
	response_set(response, "Content-Location", work->location);
	return response_send(request, status, response);
}

/* How far a reference came. */
static void set_samples(struct MHD_Response *response, const struct frame *frame)
{
	char number[16];
	snprintf(number, sizeof number, "%d", frame->samples);
	if (frame->samples > 0)
		response_set(response, "Stratus-Samples", number);
	if (frame->partial)
		response_set(response, "Stratus-Partial", "true");
}

static enum MHD_Result finish(struct request *request)
{
	struct render_work *work = request->work;
	if (work->refused)
		return call_refuse_render(request, &work->job);
	timings_set(&request->timings, TIMING_QUEUE, work->job.waited_ms);
	if (work->job.outcome != RENDER_OUTCOME_OK)
		return call_send_render_failure(request, work->job.outcome, "The image", "an image of this size and these layers");
	timings_set_frame(&request->timings, &work->job.frame);
	timings_add_optics(&request->timings, work->job.prepared_ms, work->job.prepared);
	timings_add(&request->timings, TIMING_FIELD, work->decode_ms[0]);
	timings_add(&request->timings, TIMING_SKY, work->decode_ms[1]); /* the ground is part of it */
	timings_set(&request->timings, TIMING_ENCODE, work->encode_ms);
	struct MHD_Response *response = response_create(request, (char *)work->image.data, work->image.size);
	work->image.data = NULL;
	set_samples(response, &work->job.frame);
	enum MHD_Result result = send_image(request, MHD_HTTP_OK, response);
	metrics_count_timings(request->service->metrics, &request->timings);
	metrics_count_picture(request->service->metrics,
			      (double)work->job.frame.width * work->job.frame.height * work->job.frame.layer_count);
	return result;
}

/* --- on other threads --------------------------------------------------------------------------------------------------------- */

static bool is_abandoned(struct render_job *job)
{
	const struct render_work *work = (const struct render_work *)((char *)job - offsetof(struct render_work, job));
	return call_is_abandoned(work->request);
}

static void encode(struct work *base)
{
	struct render_work *work = (struct render_work *)((char *)base - offsetof(struct render_work, encode));
	const struct image_metadata metadata = {
		.scene_json = work->canonical, .request_id = work->request->id, .software = "stratus " RENDERER_VERSION};
	char error[256] = "";
	double start = clock_now_ms();
	work->job.phase = RENDER_PHASE_ENCODING;
	/* What was cut short for the deadline goes out, even if that passes now. */
	const double deadline_ms = work->job.frame.partial ? INFINITY : work->deadline_ms;
	if (request_is_abandoned(work->request)) {
		work->job.outcome = RENDER_OUTCOME_ABANDONED;
	} else if (start >= deadline_ms) {
		work->job.outcome = RENDER_OUTCOME_EXPIRED;
	} else if (!work->request->service->images->encode(&work->job.frame, &work->input.scene, &metadata, &work->image, error,
							   sizeof error)) {
		log_error("request %s: encoding failed: %s", work->request->id, error);
		work->job.outcome = RENDER_OUTCOME_FAILED;
	} else if (clock_now_ms() >= deadline_ms) {
		work->job.outcome = RENDER_OUTCOME_EXPIRED;
	}
	work->encode_ms = clock_now_ms() - start;
	if (work->job.outcome == RENDER_OUTCOME_OK)
		cost_model_learn_encoding(work->request->service->costs, &work->input.scene, work->encode_ms);
	admission_keep(work->request, work->image.size);
	free(work->job.frame.pixels);
	work->job.frame.pixels = NULL;
	call_end_render(work->request, &work->job);
}

static void on_rendered(struct render_job *job)
{
	struct render_work *work = (struct render_work *)((char *)job - offsetof(struct render_work, job));
	preparation_release(work->request->service->preparation, job);
	scene_assets_release(&work->input.scene);
	if (job->outcome == RENDER_OUTCOME_FAILED)
		log_error("request %s: rendering failed", work->request->id);
	if (job->outcome == RENDER_OUTCOME_OK)
		worker_pool_wait(work->request->service->workers, &work->encode);
	else
		call_end_render(work->request, &work->job);
}

/* --- the way through ------------------------------------------------------------------------------------------------------------ */

/* Ends the job that a full queue refused. */
static void refuse(struct render_work *work)
{
	work->refused = true;
	request_resume(work->request);
}

static bool is_over(void *context)
{
	return render_job_is_over(context);
}

static void decode(struct work *base)
{
	struct render_work *work = (struct render_work *)((char *)base - offsetof(struct render_work, decode));
	struct service *service = work->request->service;
	work->job.waited_ms += clock_now_ms() - work->decoding_since_ms;
	work->job.outcome = RENDER_OUTCOME_FAILED;
	if (render_job_is_over(&work->job) || !scene_assets_decode(service->maps, service->decoder, &work->input.scene, &work->assets,
								   is_over, &work->job, work->job.deadline_ms, work->decode_ms))
		call_end_render(work->request, &work->job);
	else if (!preparation_push(service->preparation, &work->job))
		refuse(work);
}

/* Layers counted apart. */
static double pixels_of(const struct scene_output *output)
{
	return (double)output->width * output->height * __builtin_popcount(output->layers);
}

static enum MHD_Result enqueue(struct request *request, double deadline_ms)
{
	struct render_work *work = request->work;
	struct service *service = request->service;
	enum MHD_Result refused;
	if (!access_admit_pixels(request, pixels_of(&work->input.scene.output), &refused))
		return refused;
	work->job.scene = &work->input.scene;
	work->deadline_ms = deadline_ms;
	work->job.deadline_ms = reference_stop_ms(&work->input.scene, clock_now_ms(), deadline_ms, 0);
	work->job.abandoned = is_abandoned;
	work->job.finished = on_rendered;
	work->encode.run = encode;
	work->decode.run = decode;
	if (!admission_enter(request, &work->job.scene, 1, NULL, deadline_ms))
		return response_send_problem(request);
	admission_price(request, &work->job);
	/* Suspended first: the render thread may be done before preparation_push returns. */
	request_suspend(request, finish);
	work->decoding_since_ms = clock_now_ms();
	if (!(scene_assets_take(service->maps, &work->input.scene, &work->assets) ? preparation_push(service->preparation, &work->job)
										  : worker_pool_try(service->decoders, &work->decode)))
		refuse(work);
	return MHD_YES;
}

enum MHD_Result route_render(struct request *request)
{
	struct render_work *work = calloc(1, sizeof *work);
	if (!work)
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	work->request = request;
	scene_assets_init(&work->assets);
	request->work = work;
	request->work_destroy = work_destroy;

	read_scene(request, work);
	double deadline_ms = request_read_deadline(request);
	if (request->problem.kind != PROBLEM_NONE || service_refuses(request))
		return response_send_problem(request);
	if (!describe(work, request->service))
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	enum MHD_Result result;
	if (reference_is_timed(&work->input.scene) && !request->is_head)
		return enqueue(request, deadline_ms); /* no two of them need be the same */
	return call_answer_at_once(request, work->tag, send_image, &result) ? result : enqueue(request, deadline_ms);
}
