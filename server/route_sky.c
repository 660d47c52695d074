/* /v1/sky: the light of the clear sky, seen from the ground.
 *
 * The HTTP thread reads and checks the query and answers what needs no computing; then the request is suspended and waits among the
 * pictures for the render thread, since the sky is the pictures' own. A worker writes the answer.
 */
#include "server/routes.h"

#include "renderer/log.h"
#include "renderer/optics/optics.h"
#include "server/admission.h"
#include "server/call.h"
#include "server/clock.h"
#include "server/response.h"
#include "server/scene_assets.h"
#include "server/service.h"
#include "server/sky_query.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

struct sky_work {
	struct render_job job; /* for the render thread */
	struct work write;     /* for the worker */
	struct request *request;
	struct promise promise;
	struct sky_query query;
	struct sky_directions directions;
	char tag[ENTITY_TAG_SIZE];
	bool refused; /* the queue was full */
	char *answer;
};

static struct sky_work *work_of(struct render_job *job)
{
	return (struct sky_work *)((char *)job - offsetof(struct sky_work, job));
}

static void work_destroy(void *context)
{
	struct sky_work *work = context;
	admission_leave(work->request->service, &work->promise, false);
	free(work->job.light.radiance);
	free(work->answer);
	free(work);
}

/* --- the answer ------------------------------------------------------------------------------------------------------------------ */

static json_t *numbers_to_json(const double *numbers, int count)
{
	json_t *array = json_array();
	for (int i = 0; i < count; i++)
		json_array_append_new(array, json_real(numbers[i]));
	return array;
}

static json_t *radiance_to_json(const struct sky_work *work)
{
	const int views = work->query.view_count, azimuths = work->query.azimuth_count;
	const double *row = work->job.light.radiance;
	json_t *bands = json_array();
	for (int band = 0; band < BAND_COUNT; band++) {
		json_t *rows = json_array();
		for (int view = 0; view < views; view++, row += azimuths)
			json_array_append_new(rows, numbers_to_json(row, azimuths));
		json_array_append_new(bands, rows);
	}
	return bands;
}

static char *format_answer(const struct sky_work *work)
{
	const struct sky_query *query = &work->query;
	const struct sky_light *light = &work->job.light;
	const struct scene_sun *sun = &query->input.scene.sun;
	json_t *root = json_pack("{s:o, s:{s:f, s:f}, s:o, s:o, s:o, s:o, s:o}", "wavelength_nm",
				 numbers_to_json(band_wavelength_nm, BAND_COUNT), "sun", "elevation_deg", sun->elevation_deg, "azimuth_deg",
				 sun->azimuth_deg, "view_zenith_deg", numbers_to_json(query->view_zenith_deg, query->view_count),
				 "azimuth_deg", numbers_to_json(query->azimuth_deg, query->azimuth_count), "radiance",
				 radiance_to_json(work), "direct_transmittance", numbers_to_json(light->direct_transmittance, BAND_COUNT),
				 "diffuse_irradiance", numbers_to_json(light->diffuse_irradiance, BAND_COUNT));
	char *text = root ? json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(9)) : NULL;
	json_decref(root);
	return text;
}

/* --- answering, on the HTTP thread ------------------------------------------------------------------------------------------ */

static enum MHD_Result send_light(struct request *request, unsigned status, struct MHD_Response *response)
{
	const struct sky_work *work = request->work;
	/* The content of a map may change behind its name. */
	const bool named = *work->query.input.scene.ground.map.name;
	return call_send_json(request, status, response, work->tag, named ? CACHE_ASK : CACHE_KEEP);
}

static enum MHD_Result finish(struct request *request)
{
	struct sky_work *work = request->work;
	if (work->refused)
		return call_refuse_render(request, &work->job);
	timings_set(&request->timings, TIMING_QUEUE, work->job.waited_ms);
	if (work->job.outcome != RENDER_OUTCOME_OK)
		return call_send_render_failure(request, work->job.outcome, "The sky", "so many directions");
	timings_set(&request->timings, TIMING_SKY, work->job.light.timing.milliseconds);
	request->timings.entry[TIMING_SKY].reused = work->job.light.timing.reused;
	timings_set(&request->timings, TIMING_ENCODE, work->job.encoded_ms);
	struct MHD_Response *response = response_create(request, work->answer, strlen(work->answer));
	work->answer = NULL;
	return send_light(request, MHD_HTTP_OK, response);
}

/* --- on other threads --------------------------------------------------------------------------------------------------------- */

static bool is_abandoned(struct render_job *job)
{
	return call_is_abandoned(work_of(job)->request);
}

static void hand_back(struct sky_work *work)
{
	admission_leave(work->request->service, &work->promise, work->job.outcome == RENDER_OUTCOME_OK);
	call_end_render(work->request, &work->job);
}

static void write_answer(struct work *base)
{
	struct sky_work *work = (struct sky_work *)((char *)base - offsetof(struct sky_work, write));
	double start = clock_now_ms();
	work->job.phase = RENDER_PHASE_ENCODING;
	if (!render_job_is_over(&work->job)) {
		work->answer = format_answer(work);
		if (!work->answer) {
			log_error("request %s: out of memory", work->request->id);
			work->job.outcome = RENDER_OUTCOME_FAILED;
		}
	}
	work->job.encoded_ms = clock_now_ms() - start;
	hand_back(work);
}

static void on_computed(struct render_job *job)
{
	struct sky_work *work = work_of(job);
	if (job->outcome == RENDER_OUTCOME_FAILED)
		log_error("request %s: the sky could not be computed", work->request->id);
	if (job->outcome == RENDER_OUTCOME_OK)
		worker_pool_wait(work->request->service->workers, &work->write);
	else
		hand_back(work);
}

/* --- the way through ------------------------------------------------------------------------------------------------------------ */

static enum MHD_Result enqueue(struct request *request, double deadline_ms)
{
	struct sky_work *work = request->work;
	const struct sky_query *query = &work->query;
	work->directions = (struct sky_directions){query->view_count, query->azimuth_count, query->view_zenith_deg, query->azimuth_deg};
	work->job.scene = &query->input.scene;
	work->job.directions = &work->directions;
	work->job.deadline_ms = deadline_ms;
	work->job.abandoned = is_abandoned;
	work->job.finished = on_computed;
	work->write.run = write_answer;
	if (!admission_enter(request, &work->promise, &work->job.scene, 1, &work->directions, deadline_ms))
		return response_send_problem(request);
	admission_price(request, &work->job);
	/* Suspended first: the render thread may be done before preparation_push returns. */
	request_suspend(request, finish);
	if (!preparation_push(request->service->preparation, &work->job)) {
		work->refused = true;
		admission_leave(request->service, &work->promise, false);
		request_resume(request);
	}
	return MHD_YES;
}

/* The sky depends on the ground by its mean alone, which is known of a map without decoding it. */
static void read_query(struct request *request, struct sky_query *query)
{
	struct scene *scene = &query->input.scene;
	struct scene_assets assets;
	sky_query_read(request->query, query, &request->problem);
	scene_assets_init(&assets);
	scene_assets_find(request->service->assets, scene, &assets, &request->problem);
	scene_assets_use_mean_ground(scene, &assets);
	scene_assets_finish(scene, &assets);
}

enum MHD_Result route_sky(struct request *request)
{
	struct sky_work *work = calloc(1, sizeof *work);
	if (!work)
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	work->request = request;
	request->work = work;
	request->work_destroy = work_destroy;

	read_query(request, &work->query);
	double deadline_ms = request_read_deadline(request);
	if (request->problem.kind != PROBLEM_NONE || service_refuses(request))
		return response_send_problem(request);
	enum MHD_Result result;
	if (!call_tag(request->service, "sky", sky_query_canonical(&work->query), work->tag))
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	return call_answer_at_once(request, work->tag, send_light, &result) ? result : enqueue(request, deadline_ms);
}
