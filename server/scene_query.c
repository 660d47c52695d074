#include "server/scene_query.h"

#include "server/number_text.h"
#include "server/scene_json.h"

#include <stdlib.h>
#include <string.h>

enum { POINTER_SIZE = 512 };

/* A number, or the text itself, which the reader then refuses by its type. */
static json_t *number_or_text(const char *value)
{
	double number;
	return number_parse(value, &number) ? json_real(number) : json_string(value);
}

static json_t *element_of(const struct scene_field *field, const char *value)
{
	return field->type == FIELD_NUMBERS ? number_or_text(value) : json_string(value);
}

static json_t *list_of(const struct scene_field *field, const char *value)
{
	json_t *list = json_array();
	char *copy = strdup(value);
	char *rest = copy;
	for (char *element = strsep(&rest, ","); element; element = strsep(&rest, ","))
		json_array_append_new(list, element_of(field, element));
	free(copy);
	return list;
}

static json_t *value_to_json(const struct scene_field *field, const char *value)
{
	switch (field->type) {
	case FIELD_NUMBER:
	case FIELD_NUMBER_OR_AUTO:
	case FIELD_INTEGER:
	case FIELD_SEED:
		return number_or_text(value);
	case FIELD_NUMBERS:
	case FIELD_CHOICES:
		return list_of(field, value);
	case FIELD_BOOLEAN:
		if (strcmp(value, "true") == 0 || strcmp(value, "false") == 0)
			return json_boolean(*value == 't');
		break;
	case FIELD_CHOICE:
	case FIELD_TIME:
	case FIELD_NAME:
	case FIELD_ASSET:
	case FIELD_HASH:
		break;
	}
	return json_string(value);
}

void scene_query_read_field(const struct scene_field *field, const char *value, const char *pointer, struct scene_input *input,
			    struct problem *problem)
{
	if (scene_field_given(input, field)) {
		problem_add(problem, pointer, "is given twice");
		return;
	}
	json_t *json = value_to_json(field, value);
	scene_json_read_field(field, json, pointer, input, problem);
	json_decref(json);
}

static const struct scene_field *find_dotted(char *section)
{
	char *name = strchr(section, '.');
	if (!name)
		return NULL;
	*name = '\0';
	const struct scene_field *field = scene_field_find(section, name + 1);
	*name = '.';
	return field;
}

/* "a.b" is "/a/b". */
static void dotted_pointer(const char *dotted, char pointer[static POINTER_SIZE])
{
	char *copy = strdup(dotted), *rest = copy;
	pointer[0] = '\0';
	for (char *token = strsep(&rest, "."); token; token = strsep(&rest, "."))
		pointer_append(pointer, POINTER_SIZE, token);
	free(copy);
}

void scene_query_read(const struct query *query, bool (*wanted)(const struct scene_field *field), struct scene_input *input,
		      struct problem *problem)
{
	for (size_t i = 0; i < query->count; i++) {
		char pointer[POINTER_SIZE];
		dotted_pointer(query->pairs[i].name, pointer);
		char *name = strdup(query->pairs[i].name);
		const struct scene_field *field = name ? find_dotted(name) : NULL;
		free(name);
		if (field && (!wanted || wanted(field)))
			scene_query_read_field(field, query->pairs[i].value, pointer, input, problem);
		else
			problem_add(problem, pointer, "is not a member here");
	}
}

static bool is_wanted_by_none(const struct scene_field *field)
{
	(void)field;
	return false;
}

bool scene_query_refuse(const char *text, struct problem *problem)
{
	struct query query;
	if (query_parse(text, &query, problem))
		scene_query_read(&query, is_wanted_by_none, NULL, problem);
	query_finish(&query);
	return problem->kind == PROBLEM_NONE;
}
