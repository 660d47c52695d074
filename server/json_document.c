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

/* A number too large for a double would end the parse at the first one; it is reported here and made a null. */
static char *walk_scalar(char *c, const char *pointer, struct problem *problem)
{
	size_t length = strcspn(c, ",]} \t\r\n");
	if (length == 0)
		return *c ? c + 1 : c;
	if ((*c == '-' || (*c >= '0' && *c <= '9')) && length >= 4 && isinf(strtod(c, NULL))) {
		problem_add(problem, pointer, "is too large a number");
		memset(c, ' ', length);
		memcpy(c, "null", 4);
	}
	return c + length;
}

static char *walk_value(char *c, const char *pointer, int depth, struct problem *problem);

/* Notes the name at c (a quoted string up to end) and appends it to the pointer. */
static void note_name(const char *c, const char *end, json_t *seen, char *pointer, struct problem *problem)
{
	json_t *name = json_loadb(c, (size_t)(end - c), JSON_DECODE_ANY, NULL);
	const char *text = name ? json_string_value(name) : NULL;
	if (text) {
		pointer_append(pointer, POINTER_SIZE, text);
		if (json_object_get(seen, text))
			problem_add(problem, pointer, "is given twice");
		else
			json_object_set_new(seen, text, json_true());
	}
	json_decref(name);
}

static char *walk_object(char *c, const char *pointer, int depth, struct problem *problem)
{
	json_t *seen = json_object();
	c = skip_space(c + 1);
	while (*c == '"') {
		char member[POINTER_SIZE];
		snprintf(member, sizeof member, "%s", pointer);
		char *end = skip_string(c);
		note_name(c, end, seen, member, problem);
		c = skip_space(end);
		if (*c == ':')
			c = skip_space(walk_value(skip_space(c + 1), member, depth + 1, problem));
		if (*c == ',')
			c = skip_space(c + 1);
	}
	json_decref(seen);
	return *c == '}' ? c + 1 : c;
}

static char *walk_array(char *c, const char *pointer, int depth, struct problem *problem)
{
	c = skip_space(c + 1);
	for (int i = 0; *c && *c != ']'; i++) {
		char index[16], element[POINTER_SIZE];
		snprintf(index, sizeof index, "%d", i);
		snprintf(element, sizeof element, "%s", pointer);
		pointer_append(element, sizeof element, index);
		c = skip_space(walk_value(c, element, depth + 1, problem));
		if (*c == ',')
			c = skip_space(c + 1);
	}
	return *c ? c + 1 : c;
}

static char *walk_value(char *c, const char *pointer, int depth, struct problem *problem)
{
	if (*c == '"')
		return skip_string(c);
	if (*c != '{' && *c != '[')
		return walk_scalar(c, pointer, problem);
	if (depth >= WALK_DEPTH_MAX)
		return skip_nested(c);
	return *c == '{' ? walk_object(c, pointer, depth, problem) : walk_array(c, pointer, depth, problem);
}

json_t *json_document_parse(char *text, size_t length, struct problem *problem)
{
	json_error_t error;
	json_t *root = json_loadb(text, length, load_flags, &error);
	bool overflow = !root && json_error_code(&error) == json_error_numeric_overflow;
	if (root || overflow)
		walk_value(skip_space(text), "", 0, problem);
	if (overflow)
		root = json_loadb(text, length, load_flags, &error);
	if (!root) {
		problem_finish(problem);
		problem_set(problem, PROBLEM_NOT_JSON, "%s, at line %d, column %d.", error.text, error.line, error.column);
	}
	return root;
}
