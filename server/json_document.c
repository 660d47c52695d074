#include "server/json_document.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Below this depth nothing can be a member of a scene, so names are not compared there. */
enum { WALK_DEPTH_MAX = 8, POINTER_SIZE = 512 };

static const int load_flags = JSON_DECODE_ANY | JSON_DECODE_INT_AS_REAL;

/* The walk below sees text that the parser may not have accepted yet: it must survive anything, but need not understand it. Each
 * function takes a position and returns the next; a NUL stops all of them. */

static char *skip_space(char *c)
{
	while (*c == ' ' || *c == '\t' || *c == '\n' || *c == '\r')
		c++;
	return c;
}

static char *skip_string(char *c)
{
	for (c++; *c && *c != '"'; c++)
		if (*c == '\\' && c[1])
			c++;
	return *c ? c + 1 : c;
}

static char *skip_nested(char *c)
{
	size_t depth = 0;
	do {
		if (*c == '"') {
			c = skip_string(c);
			continue;
		}
		if (*c == '{' || *c == '[')
			depth++;
		else if (*c == '}' || *c == ']')
			depth--;
		c++;
	} while (*c && depth);
	return c;
}

/* Where the walk is. Pointers are written when something is wrong there alone: a hostile body has half a million places. */
struct place {
	const struct place *outer; /* NULL: the whole document */
	const char *name;          /* of a member; NULL: an element */
	int index;
};

static void write_pointer(const struct place *place, char pointer[static POINTER_SIZE])
{
	if (!place->outer) {
		pointer[0] = '\0';
		return;
	}
	char index[16];
	write_pointer(place->outer, pointer);
	snprintf(index, sizeof index, "%d", place->index);
	pointer_append(pointer, POINTER_SIZE, place->name ? place->name : index);
}

static void state(const struct place *place, const char *detail, struct problem *problem)
{
	char pointer[POINTER_SIZE];
	write_pointer(place, pointer);
	problem_add(problem, pointer, "%s", detail);
}

/* A number too large for a double would end the parse at the first one; it is reported here and made a null. */
static char *walk_scalar(char *c, const struct place *place, struct problem *problem)
{
	size_t length = strcspn(c, ",]} \t\r\n");
	if (length == 0)
		return *c ? c + 1 : c;
	if ((*c == '-' || (*c >= '0' && *c <= '9')) && length >= 4 && isinf(strtod(c, NULL))) {
		state(place, "is too large a number", problem);
		memset(c, ' ', length);
		memcpy(c, "null", 4);
	}
	return c + length;
}

static char *walk_value(char *c, const struct place *place, int depth, struct problem *problem);

/* The name at c, a quoted string up to end; NULL: it is none. json_decref. */
static json_t *read_name(const char *c, const char *end)
{
	json_t *name = json_loadb(c, (size_t)(end - c), JSON_DECODE_ANY, NULL);
	if (json_is_string(name))
		return name;
	json_decref(name);
	return NULL;
}

static void note_name(const struct place *place, json_t *seen, struct problem *problem)
{
	if (json_object_get(seen, place->name))
		state(place, "is given twice", problem);
	else
		json_object_set_new_nocheck(seen, place->name, json_true());
}

static char *walk_object(char *c, const struct place *outer, int depth, struct problem *problem)
{
	json_t *seen = json_object();
	c = skip_space(c + 1);
	while (*c == '"') {
		char *end = skip_string(c);
		json_t *name = read_name(c, end);
		const struct place place = {.outer = outer, .name = name ? json_string_value(name) : ""};
		if (name)
			note_name(&place, seen, problem);
		c = skip_space(end);
		if (*c == ':')
			c = skip_space(walk_value(skip_space(c + 1), &place, depth + 1, problem));
		if (*c == ',')
			c = skip_space(c + 1);
		json_decref(name);
	}
	json_decref(seen);
	return *c == '}' ? c + 1 : c;
}

static char *walk_array(char *c, const struct place *outer, int depth, struct problem *problem)
{
	struct place place = {.outer = outer};
	for (c = skip_space(c + 1); *c && *c != ']'; place.index++) {
		c = skip_space(walk_value(c, &place, depth + 1, problem));
		if (*c == ',')
			c = skip_space(c + 1);
	}
	return *c ? c + 1 : c;
}

static char *walk_value(char *c, const struct place *place, int depth, struct problem *problem)
{
	if (*c == '"')
		return skip_string(c);
	if (*c != '{' && *c != '[')
		return walk_scalar(c, place, problem);
	if (depth >= WALK_DEPTH_MAX)
		return skip_nested(c);
	return *c == '{' ? walk_object(c, place, depth, problem) : walk_array(c, place, depth, problem);
}

/* What is larger than anything that is asked for here need not be taken apart: a body of a mebibyte may hold half a million zeros, or one
 * name. Commas outside of texts are counted. */
static bool is_too_much(const char *text, struct problem *problem)
{
	size_t commas = 0;
	for (const char *c = text; *c && commas < JSON_DOCUMENT_VALUES_MAX; c++) {
		if (*c == '"') {
			const char *const end = skip_string((char *)c);
			if (*end && end - c > JSON_DOCUMENT_TEXT_MAX) {
				problem_add(problem, "", "has a text of more than %d bytes", JSON_DOCUMENT_TEXT_MAX);
				return true;
			}
			c = end - 1;
		}
		commas += *c == ',';
	}
	if (commas < JSON_DOCUMENT_VALUES_MAX)
		return false;
	problem_add(problem, "", "has more than %d members and elements in all", JSON_DOCUMENT_VALUES_MAX);
	return true;
}

/* The parser's own words, but where they are about the parser. */
static const char *words_of(const json_error_t *error)
{
	switch (json_error_code(error)) {
	case json_error_null_character:
	case json_error_null_byte_in_key:
		return "a NUL, which no text here holds";
	case json_error_out_of_memory:
		return "out of memory";
	default:
		return error->text;
	}
}

json_t *json_document_parse(char *text, size_t length, struct problem *problem)
{
	json_error_t error;
	if (is_too_much(text, problem))
		return NULL;
	json_t *root = json_loadb(text, length, load_flags, &error);
	bool overflow = !root && json_error_code(&error) == json_error_numeric_overflow;
	if (root || overflow)
		walk_value(skip_space(text), &(const struct place){0}, 0, problem);
	if (overflow)
		root = json_loadb(text, length, load_flags, &error);
	if (!root) {
		problem_finish(problem);
		problem_set(problem, PROBLEM_NOT_JSON, "%s, at line %d, column %d.", words_of(&error), error.line, error.column);
	}
	return root;
}
