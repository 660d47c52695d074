/* /v1/sun: where the sun stands at a time and place. */
#include "server/routes.h"

#include "server/query.h"
#include "server/response.h"
#include "server/scene_query.h"
#include "server/sun_position.h"

#include <string.h>

static const char *const names[] = {"time", "latitude_deg", "longitude_deg", NULL};

/* The parameters are the sun's members of a scene, without their section. */
static const char *read_parameters(struct request *request, const struct query *query, struct scene_input *input)
{
	const char *time = NULL;
	for (size_t i = 0; i < query->count; i++) {
		const struct query_pair *pair = &query->pairs[i];
		char pointer[512] = "";
		pointer_append(pointer, sizeof pointer, pair->name);
		if (name_index(names, pair->name) < 0) {
			problem_add(&request->problem, pointer, "is not a member here");
			continue;
		}
		scene_query_read_field(scene_field_find("sun", pair->name), pair->value, pointer, input, &request->problem);
		if (strcmp(pair->name, "time") == 0)
			time = pair->value;
	}
	for (int i = 0; names[i]; i++) {
		char pointer[64] = "";
		pointer_append(pointer, sizeof pointer, names[i]);
		if (!scene_field_given(input, scene_field_find("sun", names[i])))
			problem_add(&request->problem, pointer, "is needed");
	}
	return time;
}

enum MHD_Result route_sun(struct request *request)
{
	struct scene_input input = scene_input_default();
	struct query query;
	const char *time = NULL;
	json_t *answer = NULL;
	if (query_parse(request->query, &query, &request->problem))
		time = read_parameters(request, &query, &input);
	if (request->problem.kind == PROBLEM_NONE) {
		struct scene_sun sun = input.scene.sun;
		sun = sun_position_at(sun.julian_day, sun.latitude_deg, sun.longitude_deg);
		answer = json_pack("{s:f, s:f, s:s, s:f, s:f}", "elevation_deg", sun.elevation_deg, "azimuth_deg", sun.azimuth_deg, "time",
				   time, "latitude_deg", sun.latitude_deg, "longitude_deg", sun.longitude_deg);
	}
	query_finish(&query);
	return answer ? response_send_json(request, MHD_HTTP_OK, answer, CACHE_KEEP) : response_send_problem(request);
}
