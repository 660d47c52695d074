#include "server/request.h"

#include "server/admission.h"
#include "server/clock.h"
#include "server/service.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

/* The path of an absolute target ("http://host/path", sent to proxies), or the target itself. */
static const char *origin_form(const char *target)
{
	const char *host = strncmp(target, "http://", 7) == 0 ? target + 7 : strncmp(target, "https://", 8) == 0 ? target + 8 : NULL;
	if (!host)
		return target;
	const char *path = strchr(host, '/');
	return path ? path : "/";
}

struct request *request_create(struct service *service, struct connection *socket, const char *target)
{
	struct request *request = calloc(1, sizeof *request);
	if (!request)
		return NULL;
	request->service = service;
	request->socket = socket;
	request->client = connection_client(socket);
	request->started_ms = connection_begin(socket);
	request->path = strdup(origin_form(target));
	if (!request->path) {
		free(request);
		return NULL;
	}
	char *query = strchr(request->path, '?');
	if (query) {
		*query = '\0';
		request->query = query + 1;
	}
	return request;
}

void request_destroy(struct request *request)
{
	if (!request)
		return;
	if (request->work)
		request->work_destroy(request->work);
	admission_keep(request, 0);
	problem_finish(&request->problem);
	text_finish(&request->body);
	free(request->path);
	free(request);
}

const char *request_header(const struct request *request, const char *name)
{
	return MHD_lookup_connection_value(request->connection, MHD_HEADER_KIND, name);
}

/* Characters that need no escape in a URI, a header, JSON or a log line. */
static bool is_plain(const char *id)
{
	static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-._~:@/+=";
	size_t length = strspn(id, plain);
	return length > 0 && length < REQUEST_ID_SIZE && id[length] == '\0';
}

void request_identify(struct request *request)
{
	const char *sent = request_header(request, "X-Request-Id");
	if (sent && is_plain(sent)) {
		strcpy(request->id, sent);
		return;
	}
	unsigned char random[16] = {0};
	if (getrandom(random, sizeof random, 0) < 0)
		memcpy(random, &request->started_ms, sizeof request->started_ms);
	for (size_t i = 0; i < sizeof random; i++)
		snprintf(request->id + 2 * i, 3, "%02x", random[i]);
}

double request_read_deadline(struct request *request)
{
	const char *text = request_header(request, "X-Timeout-Ms");
	if (!text)
		return request->started_ms + request->service->config->timeout_ms;
	char *end;
	errno = 0;
	long milliseconds = strtol(text, &end, 10);
	while (*end == ' ' || *end == '\t')
		end++; /* blanks round a header's value are none of it (RFC 9110, 5.5) */
	if (errno != 0 || end == text || *end != '\0' || milliseconds < 1 || milliseconds > REQUEST_TIMEOUT_MS_MAX)
		problem_set(&request->problem, PROBLEM_BAD_REQUEST, "X-Timeout-Ms must be a whole number from 1 to %d.",
			    REQUEST_TIMEOUT_MS_MAX);
	return request->started_ms + (double)milliseconds;
}

void request_suspend(struct request *request, request_handler *next)
{
	request->next = next;
	request->service->suspended++;
	connection_watch(request->socket);
	MHD_suspend_connection(request->connection);
}

void request_resume(struct request *request)
{
	struct service *service = request->service;
	connection_work(request->socket);
	MHD_resume_connection(request->connection);
	service->suspended--;
}

bool request_is_abandoned(const struct request *request)
{
	if (request->socket)
		return connection_is_gone(request->socket);
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(request->connection, MHD_CONNECTION_INFO_CONNECTION_FD);
	struct pollfd poll_fd = {.fd = info ? info->connect_fd : -1, .events = POLLRDHUP};
	return poll(&poll_fd, 1, 0) > 0 && (poll_fd.revents & (POLLRDHUP | POLLHUP | POLLERR));
}
