#include "server/library_answers.h"

#include "renderer/log.h"
#include "server/clock.h"
#include "server/framing.h"
#include "server/library_reads.h"
#include "server/request_log.h"
#include "server/response.h"
#include "server/service.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdlib.h>

typedef enum MHD_Result queue_response(struct MHD_Connection *connection, unsigned status, struct MHD_Response *response);

static queue_response *of_library;

static void find_library(void)
{
	*(void **)&of_library = dlsym(RTLD_NEXT, "MHD_queue_response");
	if (of_library)
		return;
	log_error("libmicrohttpd has no MHD_queue_response: %s", dlerror());
	abort();
}

enum MHD_Result library_queue_response(struct MHD_Connection *connection, unsigned status, struct MHD_Response *response)
{
	static pthread_once_t once = PTHREAD_ONCE_INIT;
	pthread_once(&once, find_library);
	return of_library(connection, status, response);
}

/* The library says by its status alone what it met, and of 500 that lines of chunks do not fit into its memory. */
static void state_problem(struct problem *problem, unsigned status, bool in_body)
{
	switch (status) {
	case MHD_HTTP_CONTENT_TOO_LARGE:
		problem_set(problem, PROBLEM_TOO_LARGE, "The length of %s is beyond all numbers.", in_body ? "a chunk" : "the body");
		return;
	case MHD_HTTP_URI_TOO_LONG:
		problem_set(problem, PROBLEM_TARGET,
			    "The address is longer than all of a request may be before its body (--header-max-kb).");
		return;
	case MHD_HTTP_REQUEST_HEADER_FIELDS_TOO_LARGE:
		problem_set(problem, PROBLEM_HEADERS, "Request line and headers are too long, or too many (--header-max-kb).");
		return;
	case MHD_HTTP_HTTP_VERSION_NOT_SUPPORTED:
		problem_set(problem, PROBLEM_VERSION, "HTTP/1.1 and HTTP/1.0 are spoken here.");
		return;
	case MHD_HTTP_INTERNAL_SERVER_ERROR:
		if (!in_body)
			problem_set(problem, PROBLEM_INTERNAL, "Out of memory.");
		break;
	}
	problem_set(
		problem, PROBLEM_BAD_REQUEST,
		in_body ? "The body's chunks are malformed: each is its length in hexadecimal, a line's end, so many bytes, and another."
			: "The request line is malformed, or a header, or Content-Length is no whole number.");
}

/* There is no request, since nothing of it could be read: one is made for the answer, the log and the counters. */
static void refuse_line(struct MHD_Connection *connection, struct connection *socket, const struct problem *problem)
{
	struct service *service = library_reads_service(connection);
	struct request *request = service ? request_create(service, socket, "") : NULL;
	if (!request)
		return;
	request->connection = connection;
	request->problem = *problem;
	request_identify(request);
	response_send_problem_past(request);
	const double took_ms = clock_now_ms() - request->started_ms;
	const unsigned status = request->status ? request->status : STATUS_CLIENT_LEFT;
	metrics_count_request(service->metrics, ROUTE_OTHER, status, took_ms, request->bytes);
	request_log(request, status, took_ms);
	request_destroy(request);
}

void library_refuse_line(struct MHD_Connection *connection, struct connection *socket, enum library_fault fault)
{
	static const char *const details[] = {[LINE_MALFORMED] =
						      "A request begins with a method, a blank, and an address without control characters.",
					      [LINE_OF_TLS] = "This begins a session of TLS, and HTTP is spoken here in the clear.",
					      [LINE_CUT] = REQUEST_CUT};
	struct problem problem = {0};
	problem_set(&problem, PROBLEM_BAD_REQUEST, "%s", details[fault]);
	refuse_line(connection, socket, &problem);
}

static void refuse(struct MHD_Connection *connection, struct connection *socket, unsigned status)
{
	struct request *request = connection_request(socket);
	if (!request) {
		struct problem problem = {0};
		state_problem(&problem, status, false);
		refuse_line(connection, socket, &problem);
		return;
	}
	request->connection = connection;
	if (!*request->id)
		request_identify(request);
	state_problem(&request->problem, status, *request->method);
	response_send_problem_past(request);
}

/* Called by the library alone, which goes on afterwards as it is used to, since it may be anywhere in a request: it finds out that it
 * cannot send, and closes the connection. */
enum MHD_Result MHD_queue_response(struct MHD_Connection *connection, unsigned status, struct MHD_Response *response)
{
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
	refuse(connection, info ? info->socket_context : NULL, status);
	response_end_past(connection);
	return library_queue_response(connection, status, response);
}
