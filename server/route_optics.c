/* /v1/optics: the optical properties of a droplet size distribution, and the paper's fit of the slab.
 *
 * Computed by a worker: it takes some milliseconds, and HTTP threads do not compute.
 */
#include "server/routes.h"

#include "renderer/log.h"
#include "server/call.h"
#include "server/clock.h"
#include "server/number_text.h"
#include "server/query.h"
#include "server/response.h"
#include "server/scene_query.h"
#include "server/scene_rules.h"
#include "server/service.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

struct optics_work {
	struct work work;
	struct request *request;
	struct scene_input input;
	double sun_zenith_deg;
	bool zenith_given, refused;
	char tag[ENTITY_TAG_SIZE];
	double deadline_ms, queued_ms;
	enum call_outcome outcome;
	char *answer;
};

static void work_destroy(void *context)
{
	struct optics_work *work = context;
	free(work->answer);
	free(work);
}

static bool is_wanted(const struct scene_field *field)
{
	return strcmp(field->section, "dsd") == 0 || strcmp(field->section, "sun") == 0 ||
	       (strcmp(field->section, "model") == 0 && strcmp(field->name, "optics") == 0);
}

static void read_zenith(const char *value, struct optics_work *work, struct problem *problem)
{
	if (work->zenith_given)
		problem_add(problem, "/sun_zenith_deg", "is given twice");
	else if (!number_parse(value, &work->sun_zenith_deg))
		problem_add(problem, "/sun_zenith_deg", "must be a number");
	else if (!(work->sun_zenith_deg >= 0 && work->sun_zenith_deg <= 90))
		problem_add(problem, "/sun_zenith_deg", "must be from 0 to 90");
	work->zenith_given = true;
}

/* Takes sun_zenith_deg, which is no member of a scene, out of the query. */
static void take_zenith(struct query *query, struct optics_work *work, struct problem *problem)
{
	size_t kept = 0;
	for (size_t i = 0; i < query->count; i++) {
		if (strcmp(query->pairs[i].name, "sun_zenith_deg") == 0)
			read_zenith(query->pairs[i].value, work, problem);
		else
			query->pairs[kept++] = query->pairs[i];
	}
	query->count = kept;
}

static bool sun_given(const struct scene_input *input)
{
	for (const struct scene_field *field = scene_fields; field->section; field++)
		if (strcmp(field->section, "sun") == 0 && scene_field_given(input, field))
			return true;
	return false;
}

static void read_parameters(struct request *request, struct optics_work *work)
{
	struct problem *problem = &request->problem;
	struct query query;
	work->input = scene_input_default();
	if (query_parse(request->query, &query, problem)) {
		take_zenith(&query, work, problem);
		scene_query_read(&query, is_wanted, &work->input, problem);
		scene_rules_apply(&work->input, problem);
		if (work->zenith_given && sun_given(&work->input))
			problem_add(problem, "/sun_zenith_deg", "does not go with the sun's position: give one form");
	}
	query_finish(&query);
	if (work->zenith_given || problem->kind != PROBLEM_NONE)
		return;
	work->sun_zenith_deg = 90 - work->input.scene.sun.elevation_deg;
	if (work->sun_zenith_deg > 90)
		problem_add(problem, "/sun", "is below the horizon, where the fit has no row");
}

/* --- JSON ------------------------------------------------------------------------------------------------------------------------ */

static json_t *numbers_to_json(const double *numbers, int count)
{
	json_t *array = json_array();
	for (int i = 0; i < count; i++)
		json_array_append_new(array, json_real(numbers[i]));
	return array;
}

static json_t *phase_to_json(const struct optics *optics)
{
	json_t *angles = json_array(), *values = json_array();
	for (int i = 0; i < optics->angle_count; i++)
		json_array_append_new(angles, json_real(optics->angle[i] * 180 / M_PI));
	for (int band = 0; band < BAND_COUNT; band++)
		json_array_append_new(values, numbers_to_json(optics->phase[band], optics->angle_count));
	return json_pack("{s:o, s:o}", "angle_deg", angles, "value", values);
}

static json_t *fit_to_json(const struct paper_fit_table *table, double sun_zenith_deg)
{
	const struct paper_fit fit = paper_fit_table_at(table, sun_zenith_deg * M_PI / 180);
	return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f}", "beta", fit.beta, "sun_zenith_deg", sun_zenith_deg, "b", fit.b, "c", fit.c,
			 "kappa_c", fit.kappa_c, "t", fit.t, "r", fit.r);
}

static json_t *optics_to_json(const struct optics *optics, const struct paper_fit_table *table, double sun_zenith_deg)
{
	return json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "wavelength_nm", numbers_to_json(band_wavelength_nm, BAND_COUNT),
			 "extinction_per_m", numbers_to_json(optics->extinction_per_m, BAND_COUNT), "asymmetry",
			 numbers_to_json(optics->asymmetry, BAND_COUNT), "single_scattering_albedo",
			 numbers_to_json(optics->single_scattering_albedo, BAND_COUNT), "forward_peak_fraction",
			 numbers_to_json(optics->forward_peak_fraction, BAND_COUNT), "phase_function", phase_to_json(optics), "paper_fit",
			 fit_to_json(table, sun_zenith_deg));
}

/* --- computing, on a worker ------------------------------------------------------------------------------------------------------ */

static char *text_of(json_t *root)
{
	char *text = root ? json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(9)) : NULL;
	json_decref(root);
	return text;
}

static void compute(struct optics_work *work)
{
	const struct scene *scene = &work->input.scene;
	struct service *service = work->request->service;
	struct droplet_store *store = render_thread_droplets(service->render_thread);
	struct timings *timings = &work->request->timings;
	struct paper_fit_table fit;
	enum droplet_source source, fit_source;
	const double start = clock_now_ms();
	const struct droplet_tables *tables = droplet_store_get(store, &scene->dsd, scene->model.optics, &source);
	work->outcome = tables ? call_reason_to_stop(work->request, work->deadline_ms) : CALL_FAILED;
	bool good = work->outcome == CALL_OK && droplet_store_get_fit(store, &scene->dsd, scene->model.optics, &fit, &fit_source);
	timings_set(timings, TIMING_OPTICS, clock_now_ms() - start);
	timings->entry[TIMING_OPTICS].reused = good && source == DROPLETS_FROM_MEMORY && fit_source == DROPLETS_FROM_MEMORY;
	if (good)
		work->answer = text_of(optics_to_json(tables->optics, &fit, work->sun_zenith_deg));
	if (work->outcome == CALL_OK)
		work->outcome = work->answer ? call_reason_to_stop(work->request, work->deadline_ms) : CALL_FAILED;
	if (tables)
		droplet_store_release(store, tables);
	service->computing_ms = clock_now_ms() - start;
}

static void run(struct work *base)
{
	struct optics_work *work = (struct optics_work *)((char *)base - offsetof(struct optics_work, work));
	timings_set(&work->request->timings, TIMING_QUEUE, clock_now_ms() - work->queued_ms);
	work->outcome = call_reason_to_stop(work->request, work->deadline_ms);
	if (work->outcome == CALL_OK)
		compute(work);
	if (work->outcome == CALL_FAILED)
		log_error("request %s: the optics could not be computed", work->request->id);
	request_resume(work->request);
}

/* --- answering, on the HTTP thread ------------------------------------------------------------------------------------------ */

/* What the numbers follow from, as text; the caller frees. NULL when out of memory. */
static char *question_of(const struct optics_work *work)
{
	struct text text = {0};
	const struct scene *scene = &work->input.scene;
	text_printf(&text, "%a|%a|%a|%d|%a", scene->dsd.n0_per_cm3, scene->dsd.gamma, scene->dsd.effective_radius_um,
		    (int)scene->model.optics, work->sun_zenith_deg);
	return text_take(&text);
}

static enum MHD_Result send_optics(struct request *request, unsigned status, struct MHD_Response *response)
{
	const struct optics_work *work = request->work;
	return call_send_json(request, status, response, work->tag, CACHE_KEEP);
}

static enum MHD_Result finish(struct request *request)
{
	struct optics_work *work = request->work;
	if (work->refused)
		return call_refuse_computing(request);
	if (work->outcome != CALL_OK)
		return call_send_failure(request, work->outcome, "The answer");
	struct MHD_Response *response = response_create(request, work->answer, strlen(work->answer));
	work->answer = NULL;
	return send_optics(request, MHD_HTTP_OK, response);
}

enum MHD_Result route_optics(struct request *request)
{
	struct optics_work *work = calloc(1, sizeof *work);
	if (!work)
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	work->request = request;
	work->work.run = run;
	work->work.client = request->client;
	request->work = work;
	request->work_destroy = work_destroy;
	read_parameters(request, work);
	work->deadline_ms = request_read_deadline(request);
	if (request->problem.kind != PROBLEM_NONE || service_refuses(request))
		return response_send_problem(request);
	enum MHD_Result result;
	if (!call_tag(request->service, "optics", question_of(work), work->tag))
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	if (call_answer_at_once(request, work->tag, send_optics, &result))
		return result;
	work->queued_ms = clock_now_ms();
	/* Suspended first: a worker may be done before worker_pool_try returns. */
	request_suspend(request, finish);
	if (!worker_pool_try(request->service->computers, &work->work)) {
		work->refused = true;
		request_resume(request);
	}
	return MHD_YES;
}
