#include "clients/problem.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>

/* Text of a server on a terminal: control characters would be obeyed there. */
static void print_text(const char *text)
{
	for (; *text; text++)
		fputc((unsigned char)*text < 0x20 || *text == 0x7f ? ' ' : *text, stderr);
}

static const char *member(const json_t *object, const char *name)
{
	const char *text = json_string_value(json_object_get(object, name));
	return text ? text : "";
}

static void print_errors(const json_t *errors)
{
	size_t i;
	json_t *error;
	json_array_foreach(errors, i, error)
	{
		const char *pointer = member(error, "pointer");
		fputs("  ", stderr);
		print_text(*pointer ? pointer : "(whole scene)");
		fputs(": ", stderr);
		print_text(member(error, "detail"));
		fputc('\n', stderr);
	}
}

void problem_print(const struct http_response *response)
{
	json_t *problem = strstr(response->content_type, "json") ? json_loadb(response->body, response->size, 0, NULL) : NULL;
	const char *title = member(problem, "title"), *detail = member(problem, "detail");

	fprintf(stderr, "stratus: the server answers %ld", response->status);
	if (*title) {
		fputs(" ", stderr);
		print_text(title);
	}
	if (*detail && strcmp(detail, title) != 0) {
		fputs(": ", stderr);
		print_text(detail);
	}
	fputc('\n', stderr);
	print_errors(json_object_get(problem, "errors"));
	if (response->status >= 500 && *response->request_id) {
		fputs("  request id ", stderr);
		print_text(response->request_id);
		fputc('\n', stderr);
	}
	json_decref(problem);
}
