#include "server/call.h"

#include "renderer/log.h"
#include "server/admission.h"
#include "server/clock.h"
#include "server/response.h"
#include "server/service.h"

#include <stdlib.h>

bool call_tag(const struct service *service, const char *call, char *question, char tag[static ENTITY_TAG_SIZE])
{
	struct text tagged = {0};
	const struct renderer_info *device = render_thread_info(service->render_thread);
	text_printf(&tagged, "%s|%s|%s|%s|%s|%s|%d", call, question ? question : "", service->pixel_version, device->vendor,
		    device->renderer, device->version, (int)device->pass_kind);
	const bool good = question && !tagged.failed;
	if (good)
		entity_tag_of(tagged.data, tagged.length, tag);
	free(question);
	text_finish(&tagged);
	return good;
}

bool call_answer_at_once(struct request *request, const char *tag, call_sender *send, enum MHD_Result *result)
{
	/* What is kept of an answer is kept under its address, which a POST has none of (RFC 9111, 2). */
	if (!request->is_post && entity_tag_matches(request_header(request, "If-None-Match"), tag))
		*result = send(request, MHD_HTTP_NOT_MODIFIED, MHD_create_response_from_buffer(0, NULL, MHD_RESPMEM_PERSISTENT));
	else if (request->is_head)
		*result = send(request, MHD_HTTP_OK, response_create_unsized(request));
	else
		return false;
	return true;
}

enum MHD_Result call_send_json(struct request *request, unsigned status, struct MHD_Response *response, const char *tag,
			       const char *cache_control)
{
	if (status == MHD_HTTP_OK)
		response_set(response, "Content-Type", "application/json");
	response_set(response, "ETag", tag);
	response_set(response, "Cache-Control", cache_control);
	return response_send(request, status, response);
}

bool call_is_abandoned(const struct request *request)
{
	return request->service->giving_up || request_is_abandoned(request);
}

enum call_outcome call_reason_to_stop(const struct request *request, double deadline_ms)
{
	if (clock_now_ms() >= deadline_ms)
		return CALL_EXPIRED;
	if (request->service->giving_up)
		return CALL_STOPPED;
	return request_is_abandoned(request) ? CALL_ABANDONED : CALL_OK;
}

static const enum metrics_end ends[] = {[RENDER_OUTCOME_EXPIRED] = ENDED_EXPIRED,  [RENDER_OUTCOME_ABANDONED] = ENDED_ABANDONED,
					[RENDER_OUTCOME_NO_MEMORY] = ENDED_FAILED, [RENDER_OUTCOME_FAILED] = ENDED_FAILED,
					[RENDER_OUTCOME_STOPPED] = ENDED_STOPPED,  [RENDER_OUTCOME_UNAVAILABLE] = ENDED_FAILED};

/* Work is dropped for two reasons, and only its client can tell them apart: it is gone, or a shutdown gives up what it waits for. */
static enum render_outcome outcome_for(const struct request *request, enum render_outcome outcome)
{
	return outcome == RENDER_OUTCOME_ABANDONED && !request_is_abandoned(request) ? RENDER_OUTCOME_STOPPED : outcome;
}

void call_end_wait(struct request *request, enum render_outcome waited)
{
	const enum render_outcome outcome = outcome_for(request, waited);
	if (outcome != RENDER_OUTCOME_OK)
		metrics_count_end(request->service->metrics, ends[outcome]);
	request_resume(request);
}

void call_count_render(struct service *service, const struct render_job *job)
{
	const bool is_stopped = job->outcome == RENDER_OUTCOME_ABANDONED && service->giving_up;
	log_debug("%.1f ms of the renderer were predicted, it took %.1f", job->predicted_ms, job->spent_ms);
	if (job->outcome != RENDER_OUTCOME_OK)
		metrics_count_waste(service->metrics, is_stopped ? ENDED_STOPPED : ends[job->outcome], job->spent_ms + job->encoded_ms);
	else if (job->predicted_ms > 0)
		metrics_count_prediction(service->metrics, job->spent_ms / job->predicted_ms);
	if (job->outcome == RENDER_OUTCOME_ABANDONED && !is_stopped)
		metrics_count_cancellation(service->metrics, job->phase);
}

void call_end_render(struct request *request, const struct render_job *job)
{
	call_count_render(request->service, job);
	call_end_wait(request, job->outcome);
}

enum MHD_Result call_refuse_computing(struct request *request)
{
	metrics_count_rejection(request->service->metrics, REJECTED_FULL);
	return response_send_new_problem(
		request, PROBLEM_COMPUTERS_FULL,
		"Such calls are waiting: at most %d may, and of one client as many as places are left (--queue-length).",
		request->service->config->queue_length);
}

enum MHD_Result call_refuse_render(struct request *request, const struct render_job *job)
{
	admission_refuse(request, job);
	return response_send_problem(request);
}

enum MHD_Result call_send_failure(struct request *request, enum call_outcome outcome, const char *what)
{
	switch (outcome) {
	case CALL_EXPIRED:
		return response_send_new_problem(request, PROBLEM_DEADLINE, "%s was not ready within the deadline.", what);
	case CALL_ABANDONED:
		return MHD_NO;
	case CALL_STOPPED:
		return response_send_new_problem(request, PROBLEM_SHUTTING_DOWN, "%s was not done before the service shut down.", what);
	case CALL_FAILED:
	case CALL_OK:
		break;
	}
	return response_send_new_problem(request, PROBLEM_INTERNAL, "%s could not be computed. The log has the reason under %s.", what,
					 request->id);
}

enum MHD_Result call_send_render_failure(struct request *request, enum render_outcome outcome, const char *what, const char *size)
{
	switch (outcome_for(request, outcome)) {
	case RENDER_OUTCOME_EXPIRED:
		return call_send_failure(request, CALL_EXPIRED, what);
	case RENDER_OUTCOME_ABANDONED:
		return call_send_failure(request, CALL_ABANDONED, what);
	case RENDER_OUTCOME_STOPPED:
		return call_send_failure(request, CALL_STOPPED, what);
	case RENDER_OUTCOME_NO_MEMORY:
		return response_send_new_problem(request, PROBLEM_NO_MEMORY, "The device has no memory for %s now.", size);
	case RENDER_OUTCOME_UNAVAILABLE:
		return response_send_new_problem(request, PROBLEM_UNAVAILABLE, "%s could not be made: the device is gone, or another one.",
						 what);
	case RENDER_OUTCOME_FAILED:
	case RENDER_OUTCOME_OK:
		break;
	}
	return response_send_new_problem(request, PROBLEM_RENDER_FAILED, "%s could not be made. The log has the reason under %s.", what,
					 request->id);
}
