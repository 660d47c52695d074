#include "server/request_log.h"

#include "renderer/log.h"

#include <stdio.h>
#include <string.h>

enum { PATH_LOGGED = 200 };

/* Probes and scrapes come every few seconds and say nothing. */
static enum log_level level_of(const struct request *request)
{
	const enum metrics_route route = request->route ? request->route->metrics : ROUTE_OTHER;
	return route == ROUTE_HEALTHZ || route == ROUTE_READYZ || route == ROUTE_METRICS ? LOG_DEBUG : LOG_INFO;
}

/* Of the parts of a request: the total stands beside them. */
static bool is_stage(const struct timings *timings, int i)
{
	return i != TIMING_TOTAL && timings->entry[i].measured;
}

static void add_json_member(struct text *text, const char *name, const char *value)
{
	char string[LOG_JSON_STRING_SIZE(PATH_LOGGED)];
	log_json_string(value, string, sizeof string);
	text_printf(text, ",\"%s\":%s", name, string);
}

static void write_json(struct text *text, const struct request *request, const char *path, unsigned status, double milliseconds)
{
	const struct timings *timings = &request->timings;
	const char *comma = "";
	text_add(text, "\"event\":\"request\"");
	add_json_member(text, "id", request->id);
	add_json_member(text, "method", request->method);
	add_json_member(text, "path", path);
	text_printf(text, ",\"status\":%u,\"duration_ms\":%.3f,\"bytes\":%llu", status, milliseconds, (unsigned long long)request->bytes);
	if (request->cut_status)
		text_printf(text, ",\"cut\":%u", request->cut_status);
	if (*request->key)
		add_json_member(text, "key", request->key);
	if (*request->scene)
		add_json_member(text, "scene", request->scene);
	if (request->problem.kind != PROBLEM_NONE)
		add_json_member(text, "problem", problem_name(request->problem.kind));
	text_add(text, ",\"stages_ms\":{");
	for (int i = 0; i < TIMING_COUNT; i++)
		if (is_stage(timings, i)) {
			text_printf(text, "%s\"%s\":%.3f", comma, timing_names[i], timings->entry[i].milliseconds);
			comma = ",";
		}
	text_add(text, "},\"reused\":[");
	comma = "";
	for (int i = 0; i < TIMING_COUNT; i++)
		if (is_stage(timings, i) && timings->entry[i].reused) {
			text_printf(text, "%s\"%s\"", comma, timing_names[i]);
			comma = ",";
		}
	text_add(text, "]");
}

/* A value with blanks, quotes or what is not ASCII in it stands in quotes, as JSON writes it, so that lines split at blanks. */
static void add_text_value(struct text *text, const char *name, const char *value)
{
	char string[LOG_JSON_STRING_SIZE(PATH_LOGGED)];
	bool plain = true;
	for (const unsigned char *c = (const unsigned char *)value; *c; c++)
		plain &= *c > ' ' && *c < 0x7f && *c != '"' && *c != '\\';
	if (!plain)
		log_json_string(value, string, sizeof string);
	text_printf(text, " %s=%s", name, !*value ? "-" : plain ? value : string);
}

static void write_text(struct text *text, const struct request *request, const char *path, unsigned status, double milliseconds)
{
	const struct timings *timings = &request->timings;
	text_add(text, "request");
	add_text_value(text, "id", request->id);
	add_text_value(text, "method", request->method);
	add_text_value(text, "path", path);
	text_printf(text, " status=%u duration_ms=%.3f bytes=%llu", status, milliseconds, (unsigned long long)request->bytes);
	if (request->cut_status)
		text_printf(text, " cut=%u", request->cut_status);
	if (*request->key)
		add_text_value(text, "key", request->key);
	if (*request->scene)
		add_text_value(text, "scene", request->scene);
	if (request->problem.kind != PROBLEM_NONE)
		add_text_value(text, "problem", problem_name(request->problem.kind));
	for (int i = 0; i < TIMING_COUNT; i++)
		if (is_stage(timings, i))
			text_printf(text, " %s_ms=%.3f%s", timing_names[i], timings->entry[i].milliseconds,
				    timings->entry[i].reused ? ",reused" : "");
}

void request_log(const struct request *request, unsigned status, double milliseconds)
{
	const enum log_level level = level_of(request);
	struct text text = {0};
	char path[PATH_LOGGED + 1];
	if (!log_is_wanted(level))
		return;
	snprintf(path, sizeof path, "%s", request->path);
	if (log_current_format() == LOG_JSON)
		write_json(&text, request, path, status, milliseconds);
	else
		write_text(&text, request, path, status, milliseconds);
	if (text.failed)
		log_error("request %s: no memory for its line, status %u", request->id, status);
	else
		log_record(level, text.data);
	text_finish(&text);
}
