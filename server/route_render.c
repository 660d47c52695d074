/* /v1/render: a scene in, an image out.
 *
 * The HTTP thread reads and checks the scene and answers what needs no rendering, since the client or the daemon has the image already;
 * then the request is suspended. The first to ask for an image has work that goes, past the threads that decode its maps and prepare its
 * droplets where they are new, from the queue to the render thread, and from there to a worker that encodes; those who ask for the same
 * meanwhile wait with it. Each goes back to the HTTP thread with the image, or without when it is late.
 */
#include "server/routes.h"

#include "renderer/log.h"
#include "server/access.h"
#include "server/admission.h"
#include "server/cache_control.h"
#include "server/call.h"
#include "server/clock.h"
#include "server/cost_model.h"
#include "server/flight.h"
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

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What a request wants, and the work for that when it is the first to ask. The work may outlast its request, or the other way round. */
struct render_work {
	_Atomic int holders;     /* the request, and the work */
	struct request *request; /* no longer, for other threads, once its seat is left */
	struct flight_seat seat;
	struct flight flight;
	struct promise promise;
	struct render_job job; /* for the render thread */
	struct work decode;    /* for the decoder, when a map is not in memory */
	struct work encode;    /* for the worker */
	struct service *service;
	char id[REQUEST_ID_SIZE];     /* of the request */
	char client[CLIENT_KEY_SIZE]; /* likewise */
	struct scene_input input;
	struct scene_assets assets;
	double decoding_since_ms, decode_ms[SCENE_ASSETS_COUNT];
	char *canonical, *location;
	char key[DIGEST_SIZE], tag[ENTITY_TAG_SIZE];
	bool may_be_found, may_be_kept; /* among the finished images */
	bool is_kept;
};

static void work_release(void *context)
{
	struct render_work *work = context;
	if (--work->holders > 0)
		return;
	if (work->service)
		admission_leave(work->service, &work->promise, false);
	finished_image_release(work->seat.image);
	frame_finish(&work->job.frame);
	scene_assets_finish(&work->input.scene, &work->assets);
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

/* What the finished images had for a request (RFC 9211). No Age: the entity tag says that the image is what would be rendered now. */
static void set_cache_status(struct MHD_Response *response, const struct render_work *work)
{
	if (!work->may_be_found)
		response_set(response, "Cache-Status",
			     reference_is_timed(&work->input.scene) ? "stratus; fwd=bypass"
			     : work->is_kept                        ? "stratus; fwd=request; stored"
								    : "stratus; fwd=request");
	else if (work->seat.has_joined)
		response_set(response, "Cache-Status", "stratus; fwd=miss; collapsed");
	else
		response_set(response, "Cache-Status", work->is_kept ? "stratus; fwd=miss; stored" : "stratus; fwd=miss");
}

/* How far a reference came. */
static void set_samples(struct MHD_Response *response, int samples, bool partial)
{
	char number[16];
	snprintf(number, sizeof number, "%d", samples);
	if (samples > 0)
		response_set(response, "Stratus-Samples", number);
	if (partial)
		response_set(response, "Stratus-Partial", "true");
}

static struct MHD_Response *create_response(struct request *request)
{
	struct render_work *work = request->work;
	struct finished_image *image = work->seat.image;
	work->seat.image = NULL;
	metrics_count_picture(request->service->metrics, image->pixels);
	return response_create_shared(request, image);
}

/* Answers with what others had rendered; timing: how it was come by. */
static enum MHD_Result send_found(struct request *request, enum timing timing, double milliseconds)
{
	const struct render_work *work = request->work;
	struct timings spent = {0};
	const int samples = work->seat.image->samples;
	struct MHD_Response *response = create_response(request);
	set_samples(response, samples, false); /* what is partial is shared with nobody */
	if (timing == TIMING_CACHE)
		response_set(response, "Cache-Status", "stratus; hit");
	else
		set_cache_status(response, work);
	timings_set_reused(&request->timings);
	timings_set(&request->timings, timing, milliseconds);
	timings_set(&spent, timing, milliseconds);
	enum MHD_Result result = send_image(request, MHD_HTTP_OK, response);
	timings_set(&spent, TIMING_TOTAL, request->timings.entry[TIMING_TOTAL].milliseconds);
	metrics_count_timings(request->service->metrics, &spent); /* no stage ran */
	return result;
}

static enum MHD_Result finish(struct request *request)
{
	struct render_work *work = request->work;
	const struct flight_seat *seat = &work->seat;
	if (seat->refused)
		return request->problem.kind != PROBLEM_NONE ? response_send_problem(request) : call_refuse_render(request, &work->job);
	if (seat->has_joined)
		access_return_pixels(request);
	if (seat->has_arrived && !seat->has_joined)
		timings_set(&request->timings, TIMING_QUEUE, work->job.waited_ms);
	if (seat->outcome != RENDER_OUTCOME_OK)
		return call_send_render_failure(request, seat->outcome, "The image", "an image of this size and these layers");
	if (seat->has_joined)
		return send_found(request, TIMING_SHARED, clock_now_ms() - seat->boarded_ms);
	timings_set_frame(&request->timings, &work->job.frame);
	timings_add_optics(&request->timings, work->job.prepared_ms, work->job.prepared);
	timings_add(&request->timings, TIMING_FIELD, work->decode_ms[0]);
	timings_add(&request->timings, TIMING_SKY, work->decode_ms[1]); /* the ground is part of it */
	timings_set(&request->timings, TIMING_ENCODE, work->job.encoded_ms);
	admission_keep(request, seat->image->size);
	struct MHD_Response *response = create_response(request);
	set_samples(response, work->job.frame.samples, work->job.frame.partial);
	set_cache_status(response, work);
	enum MHD_Result result = send_image(request, MHD_HTTP_OK, response);
	metrics_count_timings(request->service->metrics, &request->timings);
	return result;
}

/* Just finished by others. */
static enum MHD_Result finish_found(struct request *request)
{
	const struct render_work *work = request->work;
	return send_found(request, TIMING_CACHE, clock_now_ms() - work->seat.boarded_ms);
}

/* --- on other threads --------------------------------------------------------------------------------------------------------- */

static struct render_work *work_of(struct render_job *job)
{
	return (struct render_work *)((char *)job - offsetof(struct render_work, job));
}

static struct render_work *work_at(struct flight_seat *seat)
{
	return (struct render_work *)((char *)seat - offsetof(struct render_work, seat));
}

static bool is_gone(struct flight_seat *seat)
{
	return call_is_abandoned(work_at(seat)->request);
}

static void leave(struct flight_seat *seat)
{
	struct request *request = work_at(seat)->request;
	if (seat->refused)
		request_resume(request);
	else
		call_end_wait(request, seat->outcome);
}

static bool is_abandoned(struct render_job *job)
{
	return !flight_is_wanted(&work_of(job)->flight);
}

/* The work is done; nothing here may be touched after it but by the request. */
static void end_work(struct render_work *work)
{
	struct flights *flights = work->service->flights;
	work_release(work);
	flights_close(flights);
}

static void arrive(struct render_work *work, enum render_outcome outcome, struct finished_image *image)
{
	work->job.outcome = outcome;
	call_count_render(work->service, &work->job);
	admission_leave(work->service, &work->promise, image != NULL); /* before those who wait may come again */
	flight_arrive(&work->flight, outcome, image);
	finished_image_release(image);
	end_work(work);
}

static bool is_unwanted(void *context)
{
	struct render_work *work = context;
	return !flight_is_wanted(&work->flight);
}

static struct finished_image *encode_frame(struct render_work *work)
{
	const struct frame *frame = &work->job.frame;
	const struct image_metadata metadata = {
		.scene_json = work->canonical, .request_id = work->id, .software = "stratus " RENDERER_VERSION};
	const struct image_watch watch = {is_unwanted, work};
	struct image_buffer file = {0};
	char error[256] = "";
	if (!work->service->images->encode(frame, &work->input.scene, &metadata, &watch, &file, error, sizeof error)) {
		if (!is_unwanted(work))
			log_error("request %s: encoding failed: %s", work->id, error);
		return NULL;
	}
	return finished_image_create(work->tag, file.data, file.size, (double)frame->width * frame->height * frame->layer_count,
				     frame->samples);
}

static void encode(struct work *base)
{
	struct render_work *work = (struct render_work *)((char *)base - offsetof(struct render_work, encode));
	struct finished_image *image = NULL;
	const double start = clock_now_ms();
	work->job.phase = RENDER_PHASE_ENCODING;
	if (work->job.frame.partial)
		flight_waive_deadlines(&work->flight); /* what was cut short for the deadline goes out, even if that passes now */
	bool wanted = !is_unwanted(work);
	const bool taken = wanted && frame_take_pixels(&work->job.frame);
	if (taken)
		image = encode_frame(work);
	wanted = image || !is_unwanted(work);
	if (wanted)
		encoder_care_note(&work->service->encoders, image != NULL);
	work->is_kept = image && work->may_be_kept && image_cache_keep(work->service->finished, image);
	work->job.encoded_ms = clock_now_ms() - start;
	if (image)
		cost_model_learn_encoding(work->service->costs, &work->input.scene, work->job.encoded_ms);
	frame_drop_pixels(&work->job.frame);
	arrive(work,
	       image     ? RENDER_OUTCOME_OK
	       : !wanted ? RENDER_OUTCOME_ABANDONED
	       : taken   ? RENDER_OUTCOME_FAILED
			 : RENDER_OUTCOME_NO_MEMORY,
	       image);
}

static void on_rendered(struct render_job *job)
{
	struct render_work *work = work_of(job);
	preparation_release(work->service->preparation, job);
	scene_assets_release(&work->input.scene);
	if (job->outcome == RENDER_OUTCOME_FAILED)
		log_error("request %s: rendering failed", work->id);
	if (job->outcome == RENDER_OUTCOME_OK)
		worker_pool_wait(work->service->workers, &work->encode);
	else
		arrive(work, job->outcome, NULL);
}

/* --- the way through ------------------------------------------------------------------------------------------------------------ */

/* Ends the job that a full queue refused. */
static void refuse(struct render_work *work)
{
	admission_leave(work->service, &work->promise, false);
	flight_refuse(&work->flight);
	end_work(work);
}

static bool is_over(void *context)
{
	return render_job_is_over(context);
}

static struct render_work *work_to_decode(struct work *base)
{
	return (struct render_work *)((char *)base - offsetof(struct render_work, decode));
}

static bool waits_in_vain(struct work *base)
{
	return render_job_is_over(&work_to_decode(base)->job);
}

static void decode(struct work *base)
{
	struct render_work *work = work_to_decode(base);
	struct service *service = work->service;
	work->job.waited_ms += clock_now_ms() - work->decoding_since_ms;
	work->job.outcome = RENDER_OUTCOME_FAILED;
	if (render_job_is_over(&work->job) || !scene_assets_decode(service->maps, service->decoder, &work->input.scene, &work->assets,
								   is_over, &work->job, work->job.deadline_ms, work->decode_ms))
		arrive(work, work->job.outcome, NULL);
	else if (!preparation_push(service->preparation, &work->job))
		refuse(work);
}

/* Layers counted apart. */
static double pixels_of(const struct scene_output *output)
{
	return (double)output->width * output->height * __builtin_popcount(output->layers);
}

/* The work is the caller's until it is accepted. */
static void start(struct render_work *work)
{
	struct service *service = work->service;
	struct request *request = work->request;
	work->holders++;
	if (!admission_enter(request, &work->promise, &work->job.scene, 1, NULL, work->seat.deadline_ms)) {
		refuse(work);
		return;
	}
	admission_price(request, &work->job);
	snprintf(work->client, sizeof work->client, "%s", request->client); /* the request may end before its work */
	work->job.client = work->decode.client = work->client;
	work->job.flight = work->flight.number;
	work->decoding_since_ms = clock_now_ms();
	if (!(scene_assets_take(service->maps, &work->input.scene, &work->assets) ? preparation_push(service->preparation, &work->job)
										  : worker_pool_try(service->decoders, &work->decode)))
		refuse(work);
}

static enum MHD_Result enqueue(struct request *request, double deadline_ms)
{
	struct render_work *work = request->work;
	struct service *service = request->service;
	const bool may_be_found = work->may_be_found;
	enum MHD_Result refused;
	const unsigned long others = may_be_found ? flights_find(service->flights, work->tag) : 0;
	if (others && !admission_join(request, others, &work->input.scene, deadline_ms))
		return response_send_problem(request);
	if (!access_admit_pixels(request, pixels_of(&work->input.scene.output), &refused))
		return refused;
	work->service = service;
	memcpy(work->id, request->id, sizeof work->id);
	work->seat.deadline_ms = deadline_ms;
	work->seat.is_gone = is_gone;
	work->seat.leave = leave;
	work->job.scene = &work->input.scene;
	work->job.abandoned = is_abandoned;
	work->job.finished = on_rendered;
	work->encode.run = encode;
	work->decode.run = decode;
	work->decode.is_over = waits_in_vain;
	/* Suspended first: whoever works for it may be done before flight_board or start returns. */
	request_suspend(request, finish);
	switch (flight_board(service->flights, may_be_found ? work->tag : NULL, &work->flight, &work->job.deadline_ms, &work->seat)) {
	case FLIGHT_OPENED:
		metrics_count_image(service->metrics, may_be_found ? IMAGE_MISSED : IMAGE_BYPASSED);
		if (!may_be_found) /* else those who joined have moved it */
			work->job.deadline_ms = reference_stop_ms(&work->input.scene, clock_now_ms(), deadline_ms, 0);
		start(work);
		break;
	case FLIGHT_JOINED:
		metrics_count_image(service->metrics, IMAGE_SHARED);
		render_queue_share(service->queue, work->seat.flight, request->client);
		break;
	case FLIGHT_ARRIVED:
		metrics_count_image(service->metrics, IMAGE_FROM_CACHE);
		access_return_pixels(request);
		request->next = finish_found;
		request_resume(request);
		break;
	}
	return MHD_YES;
}

/* Has an image of the scene been finished before, for whoever does not insist on a new one? */
static bool find_finished(struct request *request)
{
	struct render_work *work = request->work;
	const char *header = request_header(request, "Cache-Control");
	work->may_be_kept = !reference_is_timed(&work->input.scene) && !cache_control_names(header, "no-store");
	work->may_be_found = work->may_be_kept && !cache_control_names(header, "no-cache");
	work->seat.boarded_ms = clock_now_ms();
	work->seat.image = work->may_be_found ? image_cache_find(request->service->finished, work->tag) : NULL;
	if (work->seat.image)
		metrics_count_image(request->service->metrics, IMAGE_FROM_CACHE);
	return work->seat.image;
}

enum MHD_Result route_render(struct request *request)
{
	struct render_work *work = calloc(1, sizeof *work);
	if (!work)
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	work->request = request;
	scene_assets_init(&work->assets);
	request->work = work;
	request->work_destroy = work_release;
	work->holders = 1;

	read_scene(request, work);
	double deadline_ms = request_read_deadline(request);
	if (request->problem.kind != PROBLEM_NONE || service_refuses(request))
		return response_send_problem(request);
	if (!describe(work, request->service))
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	enum MHD_Result result;
	/* No two that depend on their time need be the same. */
	if ((!reference_is_timed(&work->input.scene) || request->is_head) && call_answer_at_once(request, work->tag, send_image, &result))
		return result;
	return find_finished(request) ? finish_found(request) : enqueue(request, deadline_ms);
}
