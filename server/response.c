#include "server/response.h"

#include "renderer/log.h"
#include "server/admission.h"
#include "server/clock.h"
#include "server/cors.h"
#include "server/entity_tag.h"
#include "server/image_cache.h"
#include "server/library_answers.h"
#include "server/service.h"

#include <gnutls/gnutls.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

struct MHD_Response *response_create(struct request *request, char *data, size_t size)
{
	request->bytes = size;
	struct MHD_Response *response = data ? MHD_create_response_from_buffer_with_free_callback(size, data, free) : NULL;
	if (!response) {
		log_error("response_create: out of memory");
		free(data);
	}
	return response;
}

static void release_image(void *image)
{
	finished_image_release(image);
}

struct MHD_Response *response_create_shared(struct request *request, struct finished_image *image)
{
	request->bytes = image->size;
	struct MHD_Response *response =
		MHD_create_response_from_buffer_with_free_callback_cls(image->size, image->data, release_image, image);
	if (!response) {
		log_error("response_create_shared: out of memory");
		finished_image_release(image);
	}
	return response;
}

static ssize_t read_nothing(void *context, uint64_t position, char *buffer, size_t size)
{
	(void)context, (void)position, (void)buffer, (void)size;
	return MHD_CONTENT_READER_END_OF_STREAM;
}

struct MHD_Response *response_create_unsized(struct request *request)
{
	struct MHD_Response *response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, 1024, read_nothing, NULL, NULL);
	request->closes = true;
	if (response && MHD_set_response_options(response, MHD_RF_HTTP_1_0_COMPATIBLE_STRICT, MHD_RO_END) == MHD_YES)
		return response;
	log_error("response_create_unsized: out of memory");
	if (response)
		MHD_destroy_response(response);
	return NULL;
}

void response_set(struct MHD_Response *response, const char *name, const char *value)
{
	if (response && MHD_add_response_header(response, name, value) != MHD_YES)
		log_error("response header %s could not be set", name);
}

static void format_timing(struct request *request, char timing[static SERVER_TIMING_SIZE])
{
	timings_set(&request->timings, TIMING_TOTAL, clock_now_ms() - request->started_ms);
	timings_format(&request->timings, timing);
}

static void keep_private(const struct request *request, struct MHD_Response *response)
{
	if (*request->key && MHD_del_response_header(response, "Cache-Control", CACHE_KEEP) == MHD_YES)
		response_set(response, "Cache-Control", CACHE_KEEP_PRIVATE);
}

static enum MHD_Result add_header_size(void *sum, enum MHD_ValueKind kind, const char *name, const char *value)
{
	(void)kind;
	*(uint64_t *)sum += strlen(name) + strlen(value) + sizeof ": \r\n" - 1;
	return MHD_YES;
}

/* Bytes before the body, as libmicrohttpd writes them: its own headers are a date, a length and now and then what becomes of the
 * connection, which is left out. */
static uint64_t head_size(unsigned status, struct MHD_Response *response)
{
	static const char own[] = "HTTP/1.1 200 \r\nDate: Sun, 06 Nov 1994 08:49:37 GMT\r\nContent-Length: 1000000\r\n\r\n";
	uint64_t size = sizeof own - 1 + strlen(MHD_get_reason_phrase_for(status));
	MHD_get_response_headers(response, add_header_size, &size);
	return size;
}

enum MHD_Result response_send(struct request *request, unsigned status, struct MHD_Response *response)
{
	if (!response)
		return MHD_NO;
	char timing[SERVER_TIMING_SIZE];
	format_timing(request, timing);
	response_set(response, "Server-Timing", timing);
	cors_allow(request, response);
	keep_private(request, response);
	response_set(response, "X-Request-Id", request->id);
	if (request->closes || connection_is_surplus(request->socket))
		response_set(response, "Connection", "close");
	if (!request->is_accepted || request->closes)
		connection_linger(request->socket);
	request->sent_before = connection_written(request->socket) + head_size(status, response);
	connection_work(request->socket);
	enum MHD_Result result = library_queue_response(request->connection, status, response);
	MHD_destroy_response(response);
	if (result == MHD_YES)
		request->status = status;
	return result;
}

/* Seconds after which trying again makes sense; 0: it makes none. */
static unsigned retry_after(const struct request *request)
{
	switch (request->problem.kind) {
	case PROBLEM_QUEUE_FULL:
	case PROBLEM_PREDICTED_LATE:
	case PROBLEM_MEMORY_LIMIT:
		return admission_retry_seconds(request);
	case PROBLEM_TRACINGS_FULL:
		return service_tracing_retry_seconds(request->service);
	case PROBLEM_COMPUTERS_FULL:
		return service_computing_retry_seconds(request->service);
	case PROBLEM_ALLOWANCE:
		return request->retry_after_s;
	case PROBLEM_UPLOADS_FULL:
	case PROBLEM_CONNECTIONS:
	case PROBLEM_STARTING:
		return 2;
	case PROBLEM_SHUTTING_DOWN:
	case PROBLEM_UNAVAILABLE:
	case PROBLEM_NO_MEMORY:
		return 5;
	default:
		return 0;
	}
}

enum MHD_Result response_send_problem(struct request *request)
{
	unsigned retry = retry_after(request);
	metrics_count_problem(request->service->metrics, request->problem.kind);
	char *text = problem_to_json(&request->problem, request->id, retry);
	struct MHD_Response *response = response_create(request, text, text ? strlen(text) : 0);
	response_set(response, "Content-Type", "application/problem+json");
	response_set(response, "Cache-Control", CACHE_NONE);
	if (retry) {
		char seconds[16];
		snprintf(seconds, sizeof seconds, "%u", retry);
		response_set(response, "Retry-After", seconds);
	}
	if (request->problem.kind == PROBLEM_NOT_ACCEPTABLE)
		response_set(response, "Vary", "Accept");
	if (request->problem.kind == PROBLEM_NO_KEY) /* RFC 6750, 3 */
		response_set(response, "WWW-Authenticate", "Bearer realm=\"stratus\"");
	if (request->problem.kind == PROBLEM_BAD_KEY)
		response_set(response, "WWW-Authenticate", "Bearer realm=\"stratus\", error=\"invalid_token\"");
	if (request->problem.kind == PROBLEM_METHOD)
		response_set(response, "Allow", request->route->allow);
	return response_send(request, problem_status(request->problem.kind), response);
}

enum MHD_Result response_send_new_problem(struct request *request, enum problem_kind kind, const char *format, ...)
{
	char detail[PROBLEM_DETAIL_SIZE];
	va_list args;
	va_start(args, format);
	vsnprintf(detail, sizeof detail, format, args);
	va_end(args);
	problem_finish(&request->problem);
	problem_set(&request->problem, kind, "%s", detail);
	return response_send_problem(request);
}

enum MHD_Result response_send_document(struct request *request, char *text, const char *content_type, const char *cache_control)
{
	char tag[ENTITY_TAG_SIZE];
	if (!text)
		return response_send_new_problem(request, PROBLEM_INTERNAL, "Out of memory.");
	size_t size = strlen(text);
	entity_tag_of(text, size, tag);
	bool known = entity_tag_matches(request_header(request, "If-None-Match"), tag);
	struct MHD_Response *response = response_create(request, text, known ? 0 : size);
	if (!known)
		response_set(response, "Content-Type", content_type);
	response_set(response, "ETag", tag);
	response_set(response, "Cache-Control", cache_control);
	return response_send(request, known ? MHD_HTTP_NOT_MODIFIED : MHD_HTTP_OK, response);
}

enum MHD_Result response_send_json(struct request *request, unsigned status, json_t *root, const char *cache_control)
{
	char *text = root ? json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(9)) : NULL;
	json_decref(root);
	if (status == MHD_HTTP_OK && strcmp(cache_control, CACHE_NONE) != 0)
		return response_send_document(request, text, "application/json", cache_control);
	struct MHD_Response *response = response_create(request, text, text ? strlen(text) : 0);
	response_set(response, "Content-Type", "application/json");
	response_set(response, "Cache-Control", cache_control);
	return response_send(request, status, response);
}

/* Past libmicrohttpd, to the client's end of the connection. The text is far smaller than a socket's buffer; a client that reads nothing
 * gets nothing. */
static bool send_past(struct MHD_Connection *connection, const char *data, size_t size)
{
	const union MHD_ConnectionInfo *tls = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_GNUTLS_SESSION);
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
	if (tls && tls->tls_session)
		return gnutls_record_send((gnutls_session_t)tls->tls_session, data, size) > 0;
	return info && send(info->connect_fd, data, size, MSG_NOSIGNAL | MSG_DONTWAIT) > 0;
}

/* headers: those of this answer, each with its end of line. */
static bool write_past(struct MHD_Connection *connection, struct connection *socket, unsigned status, const char *headers, const char *body)
{
	struct text answer = {0};
	char date[40];
	struct tm utc;
	const time_t now = time(NULL);
	strftime(date, sizeof date, "%a, %d %b %Y %H:%M:%S GMT", gmtime_r(&now, &utc));
	text_printf(&answer,
		    "HTTP/1.1 %u %s\r\nDate: %s\r\nConnection: close\r\nContent-Type: application/problem+json\r\n"
		    "Cache-Control: " CACHE_NONE "\r\n%sContent-Length: %zu\r\n\r\n%s",
		    status, MHD_get_reason_phrase_for(status), date, headers, strlen(body), body);
	const bool sent = !answer.failed && send_past(connection, answer.data, answer.length);
	text_finish(&answer);
	connection_linger(socket);
	return sent;
}

enum MHD_Result response_send_problem_past(struct request *request)
{
	struct text headers = {0};
	const char *origin = cors_origin(request);
	char timing[SERVER_TIMING_SIZE];
	const unsigned status = problem_status(request->problem.kind);
	format_timing(request, timing);
	metrics_count_problem(request->service->metrics, request->problem.kind);
	text_printf(&headers, "Server-Timing: %s\r\nX-Request-Id: %s\r\n", timing, request->id);
	if (origin)
		text_printf(&headers, "Access-Control-Allow-Origin: %s\r\nVary: Origin\r\n", origin);
	char *body = problem_to_json(&request->problem, request->id, 0);
	request->is_past = true;
	if (body && !headers.failed && write_past(request->connection, request->socket, status, headers.data, body))
		request->status = status, request->bytes = strlen(body);
	free(body);
	text_finish(&headers);
	return MHD_NO;
}

void response_end_past(struct MHD_Connection *connection)
{
	const union MHD_ConnectionInfo *tls = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_GNUTLS_SESSION);
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
	if (tls && tls->tls_session)
		gnutls_bye((gnutls_session_t)tls->tls_session, GNUTLS_SHUT_WR);
	if (info)
		shutdown(info->connect_fd, SHUT_WR);
}

enum MHD_Result response_refuse_body(struct request *request, uint64_t limit)
{
	problem_set(&request->problem, PROBLEM_TOO_LARGE, "A body has at most %llu bytes.", (unsigned long long)limit);
	return response_send_problem_past(request);
}
