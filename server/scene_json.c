#include "server/scene_json.h"

#include "server/asset_store.h"
#include "server/number_text.h"
#include "server/rfc3339.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { POINTER_SIZE = 512 };

static void *field_at(const struct scene_field *field, struct scene_input *input)
{
	return (char *)input + field->offset;
}

static void add_range_error(const struct field_range *range, const char *pointer, struct problem *problem)
{
	char low[NUMBER_TEXT_SIZE], high[NUMBER_TEXT_SIZE];
	number_format(range->low, low);
	number_format(range->high, high);
	problem_add(problem, pointer, "must be from %s to %s", low, high);
}

static bool read_number(const json_t *value, const struct field_range *range, const char *pointer, double *number, struct problem *problem)
{
	if (!json_is_number(value)) {
		problem_add(problem, pointer, "must be a number");
		return false;
	}
	double given = json_number_value(value);
	if (!(given >= range->low && given <= range->high)) {
		add_range_error(range, pointer, problem);
		return false;
	}
	*number = given + 0.0; /* no minus zero */
	return true;
}

static bool read_integer(const struct scene_field *field, const json_t *value, const char *pointer, double *number, struct problem *problem)
{
	if (!json_is_number(value) || json_number_value(value) != floor(json_number_value(value))) {
		problem_add(problem, pointer, "must be a whole number");
		return false;
	}
	if (!read_number(value, &field->range[0], pointer, number, problem))
		return false;
	unsigned bits = (unsigned)*number;
	if ((field->flags & FIELD_POWER_OF_TWO) && (bits & (bits - 1))) {
		problem_add(problem, pointer, "must be a power of two");
		return false;
	}
	return true;
}

static void read_numbers(const struct scene_field *field, const json_t *value, const char *pointer, double *numbers,
			 struct problem *problem)
{
	if (!json_is_array(value) || json_array_size(value) != (size_t)field->count) {
		problem_add(problem, pointer, "must be a list of %d numbers", field->count);
		return;
	}
	for (int i = 0; i < field->count; i++) {
		char element[POINTER_SIZE], index[16];
		snprintf(element, sizeof element, "%s", pointer);
		snprintf(index, sizeof index, "%d", i);
		pointer_append(element, sizeof element, index);
		read_number(json_array_get(value, (size_t)i), &field->range[i], element, &numbers[i], problem);
	}
}

static void add_choice_error(const struct scene_field *field, const char *pointer, struct problem *problem)
{
	char list[PROBLEM_DETAIL_SIZE] = "";
	for (int i = 0; field->choices[i]; i++) {
		size_t used = strlen(list);
		snprintf(list + used, sizeof list - used, "%s%s", i ? ", " : "", field->choices[i]);
	}
	problem_add(problem, pointer, "must be one of %s", list);
}

/* The index of a choice, or -1. A choice of a later release is both reported and returned, so that what it excludes is reported too. */
static int read_choice(const struct scene_field *field, const json_t *value, const char *pointer, struct problem *problem)
{
	int index = json_is_string(value) ? name_index(field->choices, json_string_value(value)) : -1;
	if (index < 0)
		add_choice_error(field, pointer, problem);
	else if (field->choices_later >> index & 1)
		problem_add(problem, pointer, "\"%s\" is not available yet in this release", field->choices[index]);
	return index;
}

static void read_choices(const struct scene_field *field, const json_t *value, const char *pointer, uint32_t *set, struct problem *problem)
{
	if (!json_is_array(value) || json_array_size(value) == 0) {
		problem_add(problem, pointer, "must be a list of at least one name");
		return;
	}
	uint32_t chosen = 0;
	for (size_t i = 0; i < json_array_size(value); i++) {
		char element[POINTER_SIZE], number[24];
		snprintf(element, sizeof element, "%s", pointer);
		snprintf(number, sizeof number, "%zu", i);
		pointer_append(element, sizeof element, number);
		int index = read_choice(field, json_array_get(value, i), element, problem);
		if (index >= 0 && (chosen >> index & 1))
			problem_add(problem, element, "is named twice");
		if (index >= 0)
			chosen |= 1u << index;
	}
	if (chosen)
		*set = chosen;
}

static void read_number_or_auto(const struct scene_field *field, const json_t *value, const char *pointer, struct scene_input *input,
				struct problem *problem)
{
	bool *automatic = (bool *)((char *)input + field->auto_offset);
	if (json_is_string(value) && strcmp(json_string_value(value), "auto") == 0)
		*automatic = true;
	else if (!json_is_number(value))
		problem_add(problem, pointer, "must be a number or \"auto\"");
	else if (read_number(value, &field->range[0], pointer, field_at(field, input), problem))
		*automatic = false;
}

static void read_time(const json_t *value, const char *pointer, double *julian_day, struct problem *problem)
{
	if (!json_is_string(value) || !rfc3339_parse(json_string_value(value), julian_day))
		problem_add(problem, pointer, "must be a time as in RFC 3339, such as \"2024-06-21T12:00:00Z\"");
}

static void read_asset(const json_t *value, const char *pointer, char name[static SCENE_NAME_MAX], struct problem *problem)
{
	if (json_is_string(value) && json_string_length(value) < SCENE_NAME_MAX && asset_name_is_valid(json_string_value(value)))
		strcpy(name, json_string_value(value));
	else
		problem_add(problem, pointer, "must be the name of an asset, 1 to %d letters, digits, '-', '_' and '.', no dot first",
			    SCENE_NAME_MAX - 1);
}

static void read_hash(const json_t *value, const char *pointer, char hash[static SCENE_HASH_SIZE], struct problem *problem)
{
	const char *text = json_is_string(value) ? json_string_value(value) : "";
	if (strlen(text) == SCENE_HASH_SIZE - 1 && strspn(text, "0123456789abcdef") == SCENE_HASH_SIZE - 1)
		strcpy(hash, text);
	else
		problem_add(problem, pointer, "must be %d hexadecimal digits", SCENE_HASH_SIZE - 1);
}

void scene_json_read_field(const struct scene_field *field, const json_t *value, const char *pointer, struct scene_input *input,
			   struct problem *problem)
{
	void *target = field_at(field, input);
	double number;
	int index;
	scene_field_mark_given(input, field);
	if (field->flags & FIELD_LATER) {
		problem_add(problem, pointer, "is not available yet in this release");
		return;
	}
	switch (field->type) {
	case FIELD_NUMBER:
		read_number(value, &field->range[0], pointer, target, problem);
		break;
	case FIELD_NUMBER_OR_AUTO:
		read_number_or_auto(field, value, pointer, input, problem);
		break;
	case FIELD_NUMBERS:
		read_numbers(field, value, pointer, target, problem);
		break;
	case FIELD_INTEGER:
		if (read_integer(field, value, pointer, &number, problem))
			*(int *)target = (int)number;
		break;
	case FIELD_SEED:
		if (read_integer(field, value, pointer, &number, problem))
			*(uint32_t *)target = (uint32_t)number;
		break;
	case FIELD_BOOLEAN:
		if (json_is_boolean(value))
			*(bool *)target = json_is_true(value);
		else
			problem_add(problem, pointer, "must be true or false");
		break;
	case FIELD_CHOICE:
		if ((index = read_choice(field, value, pointer, problem)) >= 0)
			*(unsigned *)target = (unsigned)index;
		break;
	case FIELD_CHOICES:
		read_choices(field, value, pointer, target, problem);
		break;
	case FIELD_TIME:
		read_time(value, pointer, target, problem);
		break;
	case FIELD_ASSET:
		read_asset(value, pointer, target, problem);
		break;
	case FIELD_HASH:
		read_hash(value, pointer, target, problem);
		break;
	case FIELD_NAME: /* names come with the assets they name; until then FIELD_LATER has answered */
		break;
	}
}

static void read_section(const char *section, const json_t *members, const char *pointer, struct scene_input *input,
			 struct problem *problem)
{
	if (!json_is_object(members)) {
		problem_add(problem, pointer, "must be an object");
		return;
	}
	const char *name;
	json_t *value;
	json_object_foreach((json_t *)members, name, value)
	{
		char member[POINTER_SIZE];
		snprintf(member, sizeof member, "%s", pointer);
		pointer_append(member, sizeof member, name);
		const struct scene_field *field = scene_field_find(section, name);
		if (field)
			scene_json_read_field(field, value, member, input, problem);
		else
			problem_add(problem, member, "is not a member of a scene");
	}
}

void scene_json_read(const json_t *root, struct scene_input *input, struct problem *problem)
{
	if (!json_is_object(root)) {
		problem_add(problem, "", "must be an object");
		return;
	}
	const char *section;
	json_t *members;
	json_object_foreach((json_t *)root, section, members)
	{
		char pointer[POINTER_SIZE] = "";
		pointer_append(pointer, sizeof pointer, section);
		if (scene_section_exists(section))
			read_section(section, members, pointer, input, problem);
		else
			problem_add(problem, pointer, "is not a member of a scene");
	}
}
