#include "server/problem.h"

#include "renderer/log.h"

#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct kind {
	unsigned status;
	const char *name; /* the last part of `type`: stable, others match on it */
	const char *title;
};

static const struct kind kinds[PROBLEM_KIND_COUNT] = {
	[PROBLEM_NONE] = {500, "internal", "Internal error"},
	[PROBLEM_NOT_JSON] = {400, "not-json", "The body is not JSON"},
	[PROBLEM_BAD_REQUEST] = {400, "bad-request", "Malformed request"},
	[PROBLEM_NO_KEY] = {401, "unauthorized", "No key, or not one of this service"},
	[PROBLEM_BAD_KEY] = {401, "unauthorized", "No key, or not one of this service"},
	[PROBLEM_NOT_FOUND] = {404, "not-found", "Nothing is here"},
	[PROBLEM_METHOD] = {405, "method-not-allowed", "Method not allowed"},
	[PROBLEM_NOT_ACCEPTABLE] = {406, "not-acceptable", "No acceptable type"},
	[PROBLEM_PRECONDITION] = {412, "precondition-failed", "The condition does not hold"},
	[PROBLEM_READ_TIMEOUT] = {408, "request-timeout", "The request came too slowly"},
	[PROBLEM_TOO_LARGE] = {413, "body-too-large", "The body is too large"},
	[PROBLEM_TARGET] = {414, "uri-too-long", "The address is too long"},
	[PROBLEM_MEDIA_TYPE] = {415, "unsupported-media-type", "Unsupported media type"},
	[PROBLEM_INVALID] = {422, "invalid-scene", "Invalid parameters"},
	[PROBLEM_BAD_ASSET] = {422, "invalid-asset", "The picture cannot be used"},
	[PROBLEM_ALLOWANCE] = {429, "allowance-used-up", "More than this key may ask for"},
	[PROBLEM_HEADERS] = {431, "headers-too-large", "The headers are too large"},
	[PROBLEM_INTERNAL] = {500, "internal", "Internal error"},
	[PROBLEM_RENDER_FAILED] = {500, "render-failed", "The image could not be made"},
	[PROBLEM_QUEUE_FULL] = {503, "queue-full", "Too much to do"},
	[PROBLEM_TRACINGS_FULL] = {503, "queue-full", "Too much to do"},
	[PROBLEM_COMPUTERS_FULL] = {503, "queue-full", "Too much to do"},
	[PROBLEM_PREDICTED_LATE] = {503, "predicted-late", "Not to be done in time"},
	[PROBLEM_MEMORY_LIMIT] = {503, "memory-limit", "Too much memory in use"},
	[PROBLEM_CONNECTIONS] = {503, "connection-limit", "Too many connections"},
	[PROBLEM_NO_MEMORY] = {503, "no-memory", "No memory for this image"},
	[PROBLEM_STARTING] = {503, "starting", "Not ready yet"},
	[PROBLEM_SHUTTING_DOWN] = {503, "shutting-down", "Shutting down"},
	[PROBLEM_UPLOADS_FULL] = {503, "queue-full", "Too much to do"},
	[PROBLEM_UNAVAILABLE] = {503, "renderer-unavailable", "No renderer for now"},
	[PROBLEM_DEADLINE] = {504, "deadline-passed", "The deadline passed"},
	[PROBLEM_VERSION] = {505, "http-version-not-supported", "Another version of HTTP"},
	[PROBLEM_STORAGE_FULL] = {507, "storage-full", "No room for this asset"},
};

void problem_finish(struct problem *problem)
{
	for (size_t i = 0; i < problem->error_count && i < PROBLEM_ERRORS_MAX; i++) {
		free(problem->errors[i].pointer);
		free(problem->errors[i].detail);
	}
	*problem = (struct problem){0};
}

void problem_set(struct problem *problem, enum problem_kind kind, const char *format, ...)
{
	if (problem->kind != PROBLEM_NONE)
		return;
	problem->kind = kind;
	va_list args;
	va_start(args, format);
	vsnprintf(problem->detail, sizeof problem->detail, format, args);
	va_end(args);
	/* A parser's words may quote a piece of a character, and JSON cannot hold that. */
	for (char *c = problem->detail; *c; c++)
		if ((unsigned char)*c >= 0x80)
			*c = '?';
}

static bool is_listed(const struct problem *problem, const char *pointer)
{
	for (size_t i = 0; i < problem->error_count && i < PROBLEM_ERRORS_MAX; i++)
		if (problem->errors[i].pointer && strcmp(problem->errors[i].pointer, pointer) == 0)
			return true;
	return false;
}

void problem_add(struct problem *problem, const char *pointer, const char *format, ...)
{
	if (is_listed(problem, pointer))
		return;
	if (problem->kind == PROBLEM_NONE)
		problem->kind = PROBLEM_INVALID;
	if (problem->error_count++ >= PROBLEM_ERRORS_MAX)
		return;
	struct problem_error *error = &problem->errors[problem->error_count - 1];
	va_list args;
	va_start(args, format);
	if (vasprintf(&error->detail, format, args) < 0)
		error->detail = NULL;
	va_end(args);
	error->pointer = strdup(pointer);
}

bool problem_mentions(const struct problem *problem, const char *pointer)
{
	size_t length = strlen(pointer);
	for (size_t i = 0; i < problem->error_count && i < PROBLEM_ERRORS_MAX; i++) {
		const char *other = problem->errors[i].pointer;
		if (other && strncmp(other, pointer, length) == 0 && (other[length] == '/' || other[length] == '\0'))
			return true;
	}
	return false;
}

const char *problem_name(enum problem_kind kind)
{
	return kinds[kind].name;
}

unsigned problem_status(enum problem_kind kind)
{
	return kinds[kind].status;
}

/* "3 members are wrong" and so on, where nothing else was said. */
static void describe(const struct problem *problem, char *detail, size_t size)
{
	if (problem->detail[0] || problem->error_count == 0)
		snprintf(detail, size, "%s", problem->detail);
	else if (problem->error_count == 1)
		snprintf(detail, size, "One member is wrong.");
	else if (problem->error_count <= PROBLEM_ERRORS_MAX)
		snprintf(detail, size, "%zu members are wrong.", problem->error_count);
	else
		snprintf(detail, size, "%zu members are wrong; the first %d are listed.", problem->error_count, PROBLEM_ERRORS_MAX);
}

static json_t *errors_to_json(const struct problem *problem)
{
	json_t *errors = json_array();
	for (size_t i = 0; i < problem->error_count && i < PROBLEM_ERRORS_MAX; i++) {
		const struct problem_error *error = &problem->errors[i];
		json_array_append_new(errors, json_pack("{s:s*, s:s*}", "pointer", error->pointer, "detail", error->detail));
	}
	return errors;
}

char *problem_to_json(const struct problem *problem, const char *request_id, unsigned retry_after_seconds)
{
	const struct kind *kind = &kinds[problem->kind];
	char detail[PROBLEM_DETAIL_SIZE];
	describe(problem, detail, sizeof detail);
	json_t *root = json_pack("{s:s+, s:s, s:i, s:s}", "type", "urn:stratus:problem:", kind->name, "title", kind->title, "status",
				 (int)kind->status, "detail", detail);
	if (root && request_id) {
		json_object_set_new(root, "instance", json_pack("s+", "urn:stratus:request:", request_id));
		json_object_set_new(root, "request_id", json_string(request_id));
	}
	if (root && problem->error_count)
		json_object_set_new(root, "errors", errors_to_json(problem));
	if (root && retry_after_seconds)
		json_object_set_new(root, "retry_after_seconds", json_integer(retry_after_seconds));
	if (root && problem->says_queue)
		json_object_set_new(root, "queue_depth", json_integer((json_int_t)problem->queue_depth));
	if (root && problem->predicted_ms > 0)
		json_object_set_new(root, "predicted_ms", json_real(round(problem->predicted_ms)));
	char *text = root ? json_dumps(root, JSON_INDENT(2)) : NULL;
	if (!text)
		log_error("problem: a JSON answer could not be written");
	json_decref(root);
	return text;
}

/* The longest prefix of at most `limit` bytes that does not split a UTF-8 character. */
static size_t clip(const char *text, size_t limit)
{
	size_t length = strlen(text);
	if (length <= limit)
		return length;
	while (limit > 0 && ((unsigned char)text[limit] & 0xc0) == 0x80)
		limit--;
	return limit;
}

void pointer_append(char *pointer, size_t size, const char *token)
{
	size_t used = strlen(pointer);
	size_t length = clip(token, size - used > 8 ? (size - used - 8) / 2 : 0);
	if (used + 1 < size)
		pointer[used++] = '/';
	for (size_t i = 0; i < length; i++) {
		if (token[i] == '~' || token[i] == '/') {
			pointer[used++] = '~';
			pointer[used++] = token[i] == '~' ? '0' : '1';
		} else {
			pointer[used++] = token[i];
		}
	}
	pointer[used] = '\0';
}
