#include "server/admission.h"

#include "server/clock.h"
#include "server/cost_model.h"
#include "server/service.h"

#include <math.h>

/* Beyond an hour nobody waits. */
enum { RETRY_SECONDS_MAX = 3600 };

/* --- sizes ------------------------------------------------------------------------------------------------------------------------ */

static double pixels_of(const struct scene *scene)
{
	const int layers = scene->output.format == IMAGE_PNG ? 1 : __builtin_popcount(scene->output.layers);
	return (double)scene->output.width * scene->output.height * layers;
}

/* The frame, and the file that is made of it: hardly larger, whatever the format. */
static double bytes_of(const struct scene *scene)
{
	const struct scene_output *output = &scene->output;
	const int sample = output->format == IMAGE_EXR ? 4 : output->bits / 8;
	return pixels_of(scene) * 3 * sample * 2;
}

static double memory_limit(const struct config *config)
{
	return (double)config->memory_mb * (1 << 20);
}

void admission_check_size(const struct config *config, const struct scene *scene, const char *pointer, struct problem *problem)
{
	const double most = (double)config->picture_mpixels * (1 << 20);
	if (pixels_of(scene) > most)
		problem_add(problem, pointer, "width x height x layers is %.0f pixels: at most %.0f here (--picture-mpixels)",
			    pixels_of(scene), most);
	else if (bytes_of(scene) > memory_limit(config))
		problem_add(problem, pointer, "takes about %.0f MiB of memory: at most %d (--memory-mb)", ceil(bytes_of(scene) / (1 << 20)),
			    config->memory_mb);
}

static void note_queue(struct request *request)
{
	request->problem.says_queue = true;
	request->problem.queue_depth = service_queue_depth(request->service);
}

/* --- memory ----------------------------------------------------------------------------------------------------------------------- */

void admission_keep(struct request *request, size_t bytes)
{
	request->service->memory_bytes += bytes - request->memory_bytes;
	request->memory_bytes = bytes;
}

static bool take_memory(struct request *request, struct promise *promise, double bytes)
{
	struct service *service = request->service;
	const size_t size = (size_t)bytes, before = atomic_fetch_add(&service->memory_bytes, size);
	promise->memory_bytes = size;
	/* Variants of a comparison may be larger together than any picture: alone they go. */
	if (before == 0 || (double)before + bytes <= memory_limit(service->config))
		return true;
	admission_leave(service, promise, false);
	note_queue(request);
	problem_set(&request->problem, PROBLEM_MEMORY_LIMIT,
		    "Pictures in work take about %zu MiB, and this one takes %.0f: at most %d together (--memory-mb).", before >> 20,
		    ceil(bytes / (1 << 20)), service->config->memory_mb);
	metrics_count_rejection(service->metrics, REJECTED_MEMORY);
	return false;
}

void admission_leave(struct service *service, struct promise *promise, bool answered)
{
	intake_leave(service->intake, &promise->place, answered, clock_now_ms());
	service->memory_bytes -= promise->memory_bytes;
	promise->memory_bytes = 0;
}

/* --- time ------------------------------------------------------------------------------------------------------------------------- */

/* Of all pictures together. What ends by itself in time costs nothing here: it is never too late. */
static struct cost cost_of(struct service *service, const struct scene *const *scenes, int count, const struct sky_directions *directions)
{
	struct cost sum = {.fresh = true};
	for (int i = 0; i < count; i++) {
		if (scenes[i]->model.name == MODEL_REFERENCE && scenes[i]->model.partial)
			continue;
		const bool needs = !directions && preparation_needs(service->preparation, scenes[i]);
		const struct cost cost = cost_model_predict(service->costs, scenes[i], directions, needs);
		sum.prepare_ms += cost.prepare_ms;
		sum.render_ms += cost.render_ms;
		sum.encode_ms += cost.encode_ms;
		sum.fresh &= cost.fresh;
	}
	return sum;
}

/* Of all who wait for droplets, and of those who come before the next of the request's client. */
static double preparation_line_ms(const struct service *service)
{
	return (double)preparation_depth(service->preparation) * preparation_typical_ms(service->preparation);
}

static double preparation_before_ms(const struct request *request)
{
	struct preparation *preparation = request->service->preparation;
	return (double)preparation_depth_before(preparation, request->client) * preparation_typical_ms(preparation);
}

/* When the answer would be there, counted from now. *alone_ms: if there were no others. */
static double predict(const struct request *request, const struct cost *cost, double *alone_ms)
{
	struct service *service = request->service;
	double prepared_ms = cost->prepare_ms;
	if (cost->prepare_ms > 0)
		prepared_ms += preparation_before_ms(request);
	const double pace = cost_model_pace(service->costs);
	const double ahead_ms = pace * render_queue_ahead_ms(service->queue, request->client, cost->render_ms);
	*alone_ms = cost->prepare_ms + pace * cost->render_ms + cost->encode_ms;
	return fmax(prepared_ms, ahead_ms) + pace * cost->render_ms + cost->encode_ms;
}

static bool is_idle(const struct service *service)
{
	return service_queue_depth(service) == 0 && render_thread_busy_ms(service->render_thread) == 0;
}

static void refuse_late(struct request *request, double finish_ms, double left_ms)
{
	request->problem.predicted_ms = finish_ms;
	note_queue(request);
	problem_set(&request->problem, PROBLEM_PREDICTED_LATE,
		    "The answer would take about %.0f ms, and %.0f ms are left until the deadline (X-Timeout-Ms).", finish_ms, left_ms);
	metrics_count_rejection(request->service->metrics, REJECTED_LATE);
}

static bool is_in_time(struct request *request, const struct cost *cost, double deadline_ms)
{
	struct service *service = request->service;
	const double left_ms = deadline_ms - clock_now_ms();
	double alone_ms, finish_ms = predict(request, cost, &alone_ms);
	if (!cost->fresh) /* only what is ahead of it counts then */
		finish_ms -= alone_ms;
	/* What is late already is answered so, with 504. */
	if (finish_ms <= left_ms || left_ms <= 0 || is_idle(service))
		return true;
	request->late_ms = alone_ms < left_ms ? finish_ms - left_ms : 0;
	refuse_late(request, finish_ms, left_ms);
	return false;
}

bool admission_join(struct request *request, unsigned long flight, const struct scene *scene, double deadline_ms)
{
	struct service *service = request->service;
	const double left_ms = deadline_ms - clock_now_ms();
	double ahead_ms, own_ms;
	if (!render_queue_foresee(service->queue, flight, request->client, &ahead_ms, &own_ms))
		return true;
	const struct cost cost = cost_model_predict(service->costs, scene, NULL, false);
	const double pace = cost_model_pace(service->costs);
	const double finish_ms = pace * ahead_ms + (cost.fresh ? pace * own_ms + cost.encode_ms : 0);
	if (finish_ms <= left_ms || left_ms <= 0)
		return true;
	request->late_ms = finish_ms - left_ms; /* what is finished by then is kept */
	refuse_late(request, finish_ms, left_ms);
	return false;
}

/* --- places ----------------------------------------------------------------------------------------------------------------------- */

/* What is done before the last of the request's client, pictures apart that no queue has yet. */
static double ahead_ms(const struct request *request, const struct cost *cost)
{
	struct service *service = request->service;
	const double unprepared_ms = preparation_ahead_ms(service->preparation, request->client);
	const double rendered_ms =
		cost_model_pace(service->costs) * (render_queue_ahead_ms(service->queue, request->client, INFINITY) + unprepared_ms);
	return cost->prepare_ms > 0 ? fmax(rendered_ms, preparation_before_ms(request)) : rendered_ms;
}

static bool take_place(struct request *request, struct promise *promise, const struct cost *cost)
{
	struct service *service = request->service;
	const int places = service->config->queue_length;
	double late_ms;
	switch (intake_enter(service->intake, &promise->place, ahead_ms(request, cost), clock_now_ms(), &late_ms)) {
	case INTAKE_TAKEN:
		return true;
	case INTAKE_FULL:
		problem_set(&request->problem, PROBLEM_QUEUE_FULL, "%d pictures are in work, and no more may (--queue-length).", places);
		break;
	case INTAKE_LONG:
		problem_set(&request->problem, PROBLEM_QUEUE_FULL,
			    "The answer would take longer than %d pictures usually do, which is as long as any may wait (--queue-length).",
			    places);
		break;
	}
	request->late_ms = late_ms;
	note_queue(request);
	metrics_count_rejection(service->metrics, REJECTED_FULL);
	return false;
}

bool admission_enter(struct request *request, struct promise *promise, const struct scene *const *scenes, int count,
		     const struct sky_directions *directions, double deadline_ms)
{
	struct service *service = request->service;
	double bytes = 0;
	for (int i = 0; i < count && !directions; i++)
		bytes += bytes_of(scenes[i]);
	const struct cost cost = cost_of(service, scenes, count, directions);
	return is_in_time(request, &cost, deadline_ms) && take_place(request, promise, &cost) && take_memory(request, promise, bytes);
}

void admission_price(const struct request *request, struct render_job *job)
{
	struct service *service = request->service;
	const double predicted_ms = cost_model_predict(service->costs, job->scene, job->directions, false).render_ms;
	job->client = request->client;
	job->device = render_thread_info(service->render_thread);                           /* which the entity tag names */
	job->predicted_ms = fmin(predicted_ms, fmax(job->deadline_ms - clock_now_ms(), 0)); /* then it is dropped */
	if (!job->directions)
		cost_model_expect(service->costs, job->scene, job->cost_ranks);
}

/* --- without room ----------------------------------------------------------------------------------------------------------------- */

void admission_refuse(struct request *request, const struct render_job *job)
{
	struct service *service = request->service;
	const struct config *config = service->config;
	if (service->stopping) {
		problem_set(&request->problem, PROBLEM_SHUTTING_DOWN, "The service is shutting down.");
		return;
	}
	const bool pixels = job->refusal == RENDER_REFUSED_PIXELS;
	note_queue(request);
	if (pixels)
		problem_set(&request->problem, PROBLEM_QUEUE_FULL,
			    "Renders of %.1f megapixels are waiting, and at most %d may (--queue-mpixels).",
			    service_queue_pixels(service) * 1e-6, config->queue_mpixels);
	else
		problem_set(
			&request->problem, PROBLEM_QUEUE_FULL,
			"No place is left: %d pictures may be in work, half of them wait for droplets or maps, and of those each client's "
			"as many as places are left (--queue-length).",
			config->queue_length);
	metrics_count_rejection(service->metrics, pixels ? REJECTED_PIXELS : REJECTED_FULL);
}

unsigned admission_retry_seconds(const struct request *request)
{
	const struct service *service = request->service;
	const double backlog_ms = cost_model_pace(service->costs) * render_queue_backlog_ms(service->queue) +
				  (service->ready ? preparation_line_ms(service) : 0);
	const double seconds = 1e-3 * (request->late_ms > 0 ? fmin(request->late_ms, backlog_ms) : backlog_ms);
	return (unsigned)fmin(fmax(ceil(seconds), 1), RETRY_SECONDS_MAX);
}
