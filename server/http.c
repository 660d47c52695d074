#include "server/http.h"

#include "renderer/log.h"
#include "server/access.h"
#include "server/clock.h"
#include "server/cors.h"
#include "server/negotiation.h"
#include "server/request_log.h"
#include "server/response.h"
#include "server/routes.h"
#include "server/tls.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <unistd.h>

/* Request line and headers of one connection, and those of its answer, share this much. */
enum { CONNECTION_MEMORY = 64 << 10, CONNECTIONS_MAX = 1024, IDLE_SECONDS = 30, HTTP_THREADS = 2 };

static void *on_target(void *context, const char *target, struct MHD_Connection *connection)
{
	(void)connection;
	return request_create(context, target);
}

static bool allows(const struct route *route, const char *method)
{
	size_t length = strlen(method);
	for (const char *c = route->allow; c && *c; c += strspn(c, ", ")) {
		size_t word = strcspn(c, ",");
		if (word == length && strncmp(c, method, length) == 0)
			return true;
		c += word;
	}
	return false;
}

static bool is_encoded(const struct request *request)
{
	const char *encoding = request_header(request, "Content-Encoding");
	return encoding && *encoding && strcasecmp(encoding, "identity") != 0;
}

static bool announces_too_much(const struct request *request)
{
	const char *length = request_header(request, "Content-Length");
	return length && strtoull(length, NULL, 10) > REQUEST_BODY_MAX;
}

/* The headers are in: what is wrong already is answered before a body is read. */
static enum MHD_Result begin(struct request *request, const char *method)
{
	request_identify(request);
	request->is_post = strcmp(method, MHD_HTTP_METHOD_POST) == 0;
	request->is_put = strcmp(method, MHD_HTTP_METHOD_PUT) == 0;
	request->is_head = strcmp(method, MHD_HTTP_METHOD_HEAD) == 0;
	snprintf(request->method, sizeof request->method, "%s", method);
	request->route = routes_find(request->path);
	request->next = request->route->handler;
	enum MHD_Result answered;
	if (cors_answer_preflight(request, &answered) || !access_admit(request, &answered))
		return answered;
	if (!request->route->allow)
		return request->next(request);
	if (!allows(request->route, method))
		return response_send_new_problem(request, PROBLEM_METHOD, "This address takes %s.", request->route->allow);
	if (request->is_post && !negotiation_is_json(request_header(request, "Content-Type")))
		return response_send_new_problem(request, PROBLEM_MEDIA_TYPE,
						 "The body must be JSON, sent as Content-Type: application/json.");
	if ((request->is_post || request->is_put) && is_encoded(request))
		return response_send_new_problem(request, PROBLEM_MEDIA_TYPE, "The body must be sent without a Content-Encoding.");
	if (request->is_put)
		return route_asset_begin(request);
	if (announces_too_much(request))
		return response_send_new_problem(request, PROBLEM_TOO_LARGE, "A body has at most %d bytes.", REQUEST_BODY_MAX);
	return MHD_YES;
}

static enum MHD_Result take_body(struct request *request, const char *data, size_t size)
{
	if (request->is_put)
		return route_asset_take(request, data, size);
	if (request->body.length + size > REQUEST_BODY_MAX)
		return response_refuse_body(request, REQUEST_BODY_MAX);
	text_append(&request->body, data, size);
	return MHD_YES;
}

static enum MHD_Result on_access(void *context, struct MHD_Connection *connection, const char *url, const char *method, const char *version,
				 const char *data, size_t *size, void **state)
{
	struct request *request = *state;
	(void)context, (void)url, (void)version;
	if (!request)
		return MHD_NO;
	if (!request->connection) {
		request->connection = connection;
		return begin(request, method);
	}
	if (*size) {
		enum MHD_Result result = take_body(request, data, *size);
		*size = 0;
		return result;
	}
	/* Whole now: from here on a shutdown waits for its answer. */
	if (!request->is_accepted)
		request->service->in_flight++;
	request->is_accepted = true;
	return request->next(request);
}

static void on_completed(void *context, struct MHD_Connection *connection, void **state, enum MHD_RequestTerminationCode code)
{
	struct service *service = context;
	struct request *request = *state;
	(void)connection, (void)code;
	if (!request)
		return;
	double took = clock_now_ms() - request->started_ms;
	unsigned status = request->status ? request->status : 499;
	enum metrics_route route = request->route ? request->route->metrics : ROUTE_OTHER;
	if (request->is_head)
		request->bytes = 0; /* those that a GET would send */
	/* Without a method: the headers never came, or libmicrohttpd refused them by itself. */
	metrics_count_request(service->metrics, route, status, took, request->bytes);
	access_end(request, status);
	request_log(request, status, took);
	if (request->is_accepted)
		service->in_flight--;
	request_destroy(request);
	*state = NULL;
}

static void on_library_log(void *context, const char *format, va_list args)
{
	char text[512];
	(void)context;
	vsnprintf(text, sizeof text, format, args);
	text[strcspn(text, "\n")] = '\0';
	log_debug("libmicrohttpd: %s", text);
}

/* getaddrinfo would cut a larger number to 16 bits. */
static bool is_port(const char *text)
{
	return text[strspn(text, "0123456789")] == '\0' && strtoul(text, NULL, 10) <= 65535;
}

/* Splits HOST:PORT or [IPv6]:PORT. */
static bool split_address(const char *listen, char *host, size_t size, const char **port)
{
	const char *colon = strrchr(listen, ':');
	if (!colon || !colon[1] || !is_port(colon + 1))
		return false;
	size_t length = (size_t)(colon - listen);
	if (length >= 2 && listen[0] == '[' && colon[-1] == ']') {
		listen++;
		length -= 2;
	} else if (memchr(listen, ':', length)) {
		return false;
	}
	if (length == 0 || length >= size)
		return false;
	memcpy(host, listen, length);
	host[length] = '\0';
	*port = colon + 1;
	return true;
}

/* silent: what is wrong is said elsewhere. */
static struct addrinfo *resolve(const char *listen, char *host, size_t size, bool silent)
{
	const struct addrinfo hints = {.ai_flags = AI_PASSIVE | AI_NUMERICSERV, .ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM};
	struct addrinfo *addresses = NULL;
	const char *port;
	if (!split_address(listen, host, size, &port)) {
		if (!silent)
			log_error("--listen %s: must be HOST:PORT or [IPv6]:PORT, PORT from 0 to 65535", listen);
		return NULL;
	}
	int error = getaddrinfo(host, port, &hints, &addresses);
	if (error) {
		if (!silent)
			log_error("--listen %s: %s", listen, gai_strerror(error));
		return NULL;
	}
	return addresses;
}

bool http_can_listen(const char *listen)
{
	char host[256];
	struct addrinfo *address = resolve(listen, host, sizeof host, false);
	if (!address)
		return false;
	const int fd = socket(address->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0), reuse = 1;
	if (fd >= 0)
		setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof reuse);
	const bool bound = fd >= 0 && bind(fd, address->ai_addr, address->ai_addrlen) == 0;
	const int error = errno;
	if (fd >= 0)
		close(fd);
	freeaddrinfo(address);
	if (!bound && error == EADDRINUSE)
		log_warning("--listen %s: another process listens there now", listen);
	else if (!bound)
		log_error("--listen %s: %s", listen, strerror(error));
	return bound || error == EADDRINUSE;
}

static bool is_loopback(const struct sockaddr *address)
{
	if (address->sa_family == AF_INET)
		return ntohl(((const struct sockaddr_in *)address)->sin_addr.s_addr) >> 24 == IN_LOOPBACKNET;
	if (address->sa_family != AF_INET6)
		return false;
	const struct in6_addr *host = &((const struct sockaddr_in6 *)address)->sin6_addr;
	return IN6_IS_ADDR_LOOPBACK(host) || (IN6_IS_ADDR_V4MAPPED(host) && host->s6_addr[12] == IN_LOOPBACKNET);
}

bool http_is_local(const char *listen)
{
	char host[256];
	struct addrinfo *address = resolve(listen, host, sizeof host, true);
	const bool local = !address || is_loopback(address->ai_addr);
	if (address)
		freeaddrinfo(address);
	return local;
}

static struct MHD_Daemon *start_daemon(struct service *service, const struct addrinfo *address)
{
	unsigned flags = MHD_USE_EPOLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ITC | MHD_USE_ERROR_LOG;
	if (address->ai_family == AF_INET6)
		flags |= MHD_USE_IPv6;
	if (service->config->tls_cert)
		flags |= MHD_USE_TLS;
	/* Options end where the certificate's would begin when there is none. */
	const enum MHD_OPTION certificate = service->config->tls_cert ? MHD_OPTION_HTTPS_CERT_CALLBACK2 : MHD_OPTION_END;
	return MHD_start_daemon(flags, 0, NULL, NULL, on_access, service, MHD_OPTION_EXTERNAL_LOGGER, on_library_log, NULL,
				MHD_OPTION_SOCK_ADDR, address->ai_addr, MHD_OPTION_URI_LOG_CALLBACK, on_target, service,
				MHD_OPTION_NOTIFY_COMPLETED, on_completed, service, MHD_OPTION_CONNECTION_MEMORY_LIMIT,
				(size_t)CONNECTION_MEMORY, MHD_OPTION_CONNECTION_LIMIT, (unsigned)CONNECTIONS_MAX,
				MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)IDLE_SECONDS, MHD_OPTION_THREAD_POOL_SIZE, (unsigned)HTTP_THREADS,
				certificate, tls_retrieve, MHD_OPTION_HTTPS_PRIORITIES, TLS_PRIORITIES, MHD_OPTION_END);
}

bool http_start(struct service *service)
{
	char host[sizeof service->host - 2];
	struct addrinfo *address = resolve(service->config->listen, host, sizeof host, false);
	if (!address)
		return false;
	service->daemon = start_daemon(service, address);
	snprintf(service->host, sizeof service->host, address->ai_family == AF_INET6 ? "[%s]" : "%s", host);
	freeaddrinfo(address);
	if (!service->daemon) {
		log_error("--listen %s: MHD_start_daemon failed: is the address in use, or not this machine's?", service->config->listen);
		return false;
	}
	const union MHD_DaemonInfo *info = MHD_get_daemon_info(service->daemon, MHD_DAEMON_INFO_BIND_PORT);
	service->port = info ? info->port : 0;
	return true;
}

void http_quiesce(struct service *service)
{
	if (!service->daemon)
		return;
	/* libmicrohttpd's threads may hold the number a little longer: connections are refused from here on, closing waits. */
	service->listening_socket = MHD_quiesce_daemon(service->daemon);
	if (service->listening_socket >= 0)
		shutdown(service->listening_socket, SHUT_RDWR);
}

void http_stop(struct service *service)
{
	if (service->daemon)
		MHD_stop_daemon(service->daemon);
	service->daemon = NULL;
	if (service->listening_socket >= 0)
		close(service->listening_socket);
	service->listening_socket = -1;
}
