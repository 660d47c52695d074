#include "server/sky_query.h"

#include "server/number_text.h"
#include "server/query_list.h"
#include "server/scene_canonical.h"
#include "server/scene_rules.h"
#include "server/text.h"

#include <stdlib.h>
#include <string.h>

static const struct query_list view_list = {"view_zenith_deg", 0, 90, SKY_VIEWS_MAX};
static const struct query_list azimuth_list = {"azimuth_deg", -360, 720, SKY_AZIMUTHS_MAX};

static struct sky_query query_default(void)
{
	return (struct sky_query){
		.input = scene_input_default(),
		.view_count = 6,
		.view_zenith_deg = {0, 15, 30, 45, 60, 75},
		.azimuth_count = 8,
		.azimuth_deg = {0, 45, 90, 135, 180, 225, 270, 315},
	};
}

static bool take_list(const struct query_list *list, const struct query_pair *pair, bool *given, double *numbers, int *count,
		      struct problem *problem)
{
	if (strcmp(pair->name, list->name) != 0)
		return false;
	char pointer[64] = "";
	pointer_append(pointer, sizeof pointer, list->name);
	if (*given)
		problem_add(problem, pointer, "is given twice");
	else
		query_list_read(list, pair->value, numbers, count, problem);
	*given = true;
	return true;
}

/* Takes the directions, which are no members of a scene, out of the pairs. */
static void take_directions(struct query *pairs, struct sky_query *query, struct problem *problem)
{
	size_t kept = 0;
	bool views = false, azimuths = false;
	for (size_t i = 0; i < pairs->count; i++) {
		const struct query_pair *pair = &pairs->pairs[i];
		if (!take_list(&view_list, pair, &views, query->view_zenith_deg, &query->view_count, problem) &&
		    !take_list(&azimuth_list, pair, &azimuths, query->azimuth_deg, &query->azimuth_count, problem))
			pairs->pairs[kept++] = *pair;
	}
	pairs->count = kept;
}

static bool is_wanted(const struct scene_field *field)
{
	return strcmp(field->section, "sun") == 0 || strcmp(field->section, "atmosphere") == 0 || strcmp(field->section, "ground") == 0;
}

void sky_query_read(const char *text, struct sky_query *query, struct problem *problem)
{
	struct query pairs;
	*query = query_default();
	if (query_parse(text, &pairs, problem)) {
		take_directions(&pairs, query, problem);
		scene_query_read(&pairs, is_wanted, &query->input, problem);
		scene_rules_apply(&query->input, problem);
		query->input.scene.clouds.type = CLOUD_NONE;
	}
	query_finish(&pairs);
}

static void add_list(struct text *text, const char *name, const double *numbers, int count)
{
	char value[NUMBER_TEXT_SIZE];
	text_printf(text, "&%s=", name);
	for (int i = 0; i < count; i++) {
		number_format(numbers[i], value);
		text_printf(text, "%s%s", i ? "," : "", value);
	}
}

char *sky_query_canonical(const struct sky_query *query)
{
	struct text text = {0};
	char *scene = scene_canonical(&query->input.scene);
	text_add(&text, scene ? scene : "");
	add_list(&text, view_list.name, query->view_zenith_deg, query->view_count);
	add_list(&text, azimuth_list.name, query->azimuth_deg, query->azimuth_count);
	if (!scene)
		text.failed = true;
	free(scene);
	return text_take(&text);
}
