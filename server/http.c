#include "server/http.h"

#include "renderer/log.h"
#include "server/access.h"
#include "server/clock.h"
#include "server/cors.h"
#include "server/framing.h"
#include "server/library_reads.h"
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
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

enum { IDLE_SECONDS = 30, HTTP_THREADS = 2 };

/* A connection may have a file on its way; besides there are uploads, libraries, and what lingers. */
enum { DESCRIPTORS_EACH = 2, DESCRIPTORS_BESIDE = 256 };

/* Request line and headers of one connection, and those of its answer, share this much: enough to read what is too large, and say so. */
static size_t connection_memory(const struct config *config)
{
	return 2 * ((size_t)config->header_max_kb << 10) + (32 << 10);
}

static size_t body_max(const struct request *request)
{
	return (size_t)request->service->config->body_max_kb << 10;
}

/* libmicrohttpd would make a list of the query's members, which nobody reads, in the memory of the connection; some thousands of them use
 * that up. */
static void hide_query(const char *target)
{
	char *query = strchr(target, '?');
	if (query && query[1])
		query[1] = '\0';
}

static void *on_target(void *context, const char *target, struct MHD_Connection *connection)
{
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
	struct connection *socket = info ? info->socket_context : NULL;
	struct request *request = request_create(context, socket, target);
	connection_set_request(socket, request);
	hide_query(target);
	return request;
}

static enum MHD_Result on_accept(void *context, const struct sockaddr *address, socklen_t size)
{
	struct service *service = context;
	(void)size;
	return connections_accept(service->connections, address) ? MHD_YES : MHD_NO;
}

static void on_connection(void *context, struct MHD_Connection *connection, void **socket_context, enum MHD_ConnectionNotificationCode code)
{
	struct service *service = context;
	if (code == MHD_CONNECTION_NOTIFY_CLOSED) {
		library_reads_close(connection);
		connection_close(*socket_context);
		*socket_context = NULL;
		return;
	}
	const union MHD_ConnectionInfo *fd = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
	const union MHD_ConnectionInfo *address = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
	*socket_context = fd ? connection_open(service->connections, fd->connect_fd, address ? address->client_addr : NULL) : NULL;
	library_reads_open(service, connection, *socket_context);
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

static bool has_body(const struct request *request)
{
	const char *length = request_header(request, "Content-Length");
	return (length && strtoull(length, NULL, 10) > 0) || request_header(request, "Transfer-Encoding");
}

static bool is_encoded(const struct request *request)
{
	const char *encoding = request_header(request, "Content-Encoding");
	return encoding && *encoding && strcasecmp(encoding, "identity") != 0;
}

static bool announces_too_much(const struct request *request)
{
	const char *length = request_header(request, "Content-Length");
	return length && strtoull(length, NULL, 10) > body_max(request);
}

static bool has_large_headers(const struct request *request)
{
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(request->connection, MHD_CONNECTION_INFO_REQUEST_HEADER_SIZE);
	return info && info->header_size > (size_t)request->service->config->header_max_kb << 10;
}

/* Beyond its limits the service still says how it is. */
static bool is_probe(const struct request *request)
{
	const enum metrics_route route = request->route->metrics;
	return route == ROUTE_HEALTHZ || route == ROUTE_READYZ || route == ROUTE_METRICS;
}

static enum MHD_Result refuse_connection(struct request *request)
{
	const struct config *config = request->service->config;
	metrics_count_rejection(request->service->metrics, REJECTED_CONNECTIONS);
	return response_send_new_problem(
		request, PROBLEM_CONNECTIONS,
		"At most %zu connections at a time (--connections), %d of each address (--connections-per-address).",
		connections_total(request->service->connections), config->connections_per_address);
}

/* The headers are in: what is wrong already is answered before a body is read. */
static enum MHD_Result begin(struct request *request, const char *method, const char *version)
{
	request_identify(request);
	request->is_post = strcmp(method, MHD_HTTP_METHOD_POST) == 0;
	request->is_put = strcmp(method, MHD_HTTP_METHOD_PUT) == 0;
	request->is_head = strcmp(method, MHD_HTTP_METHOD_HEAD) == 0;
	snprintf(request->method, sizeof request->method, "%s", method);
	request->route = routes_find(request->path);
	request->next = request->route->handler;
	connection_expect_body(request->socket);
	const char *fault = framing_fault(request->connection, version);
	if (fault) {
		request->closes = true;
		return response_send_new_problem(request, PROBLEM_BAD_REQUEST, "%s", fault);
	}
	if (has_large_headers(request))
		return response_send_new_problem(request, PROBLEM_HEADERS,
						 "Request line and headers have at most %d KiB (--header-max-kb).",
						 request->service->config->header_max_kb);
	if (connection_is_surplus(request->socket) && !is_probe(request))
		return refuse_connection(request);
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
		return response_send_new_problem(request, PROBLEM_TOO_LARGE, "A body has at most %zu bytes (--body-max-kb).",
						 body_max(request));
	return MHD_YES;
}

static enum MHD_Result take_body(struct request *request, const char *data, size_t size)
{
	connection_receive(request->socket, size);
	if (request->is_put)
		return route_asset_take(request, data, size);
	if (request->body.length + size > body_max(request))
		return response_refuse_body(request, body_max(request));
	text_append(&request->body, data, size);
	return MHD_YES;
}

static enum MHD_Result on_access(void *context, struct MHD_Connection *connection, const char *url, const char *method, const char *version,
				 const char *data, size_t *size, void **state)
{
	struct request *request = *state;
	(void)context, (void)url;
	if (!request)
		return MHD_NO;
	if (!request->connection) {
		request->connection = connection;
		/* An answer to this first call ends the connection, which without a body nothing asks for. */
		return has_body(request) ? begin(request, method, version) : MHD_YES;
	}
	if (*size) {
		enum MHD_Result result = take_body(request, data, *size);
		*size = 0;
		return result;
	}
	connection_work(request->socket);
	/* Whole now: from here on a shutdown waits for its answer. */
	if (!request->is_accepted)
		request->service->in_flight++;
	request->is_accepted = true;
	if (!*request->method) {
		const enum MHD_Result result = begin(request, method, version);
		if (result != MHD_YES || request->status)
			return result;
	}
	return request->next(request);
}

/* The client ended in the middle of what it sends. It may still read, then it hears why nothing comes (RFC 9112, 8). */
static void refuse_part(struct request *request, struct MHD_Connection *connection)
{
	request->connection = connection;
	if (!*request->id)
		request_identify(request);
	problem_set(&request->problem, PROBLEM_BAD_REQUEST, "%s", REQUEST_CUT);
	response_send_problem_past(request);
}

/* The client left in the middle of its answer, or did not read it for IDLE_SECONDS: what it has of it counts. */
static void cut(struct request *request)
{
	const uint64_t gone = connection_acknowledged(request->socket);
	const uint64_t taken = gone > request->sent_before ? gone - request->sent_before : 0;
	request->cut_status = request->status;
	request->bytes = taken < request->bytes ? taken : request->bytes;
}

/* Bytes of all of a request; 0: not known. */
static uint64_t whole_size(const struct request *request)
{
	if (!request->is_accepted || request_header(request, "Transfer-Encoding"))
		return 0;
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(request->connection, MHD_CONNECTION_INFO_REQUEST_HEADER_SIZE);
	const char *length = request_header(request, "Content-Length");
	return info ? info->header_size + (length ? strtoull(length, NULL, 10) : 0) : 0;
}

static void on_completed(void *context, struct MHD_Connection *connection, void **state, enum MHD_RequestTerminationCode code)
{
	struct service *service = context;
	struct request *request = *state;
	if (!request)
		return;
	const bool is_slow = connection_is_slow(request->socket);
	if (!request->status && !is_slow && code == MHD_REQUEST_TERMINATED_CLIENT_ABORT)
		refuse_part(request, connection);
	else if (request->status && !request->is_past && code != MHD_REQUEST_TERMINATED_COMPLETED_OK)
		cut(request);
	if (code == MHD_REQUEST_TERMINATED_COMPLETED_OK)
		library_reads_end(connection, whole_size(request));
	double took = clock_now_ms() - request->started_ms;
	unsigned status = request->status && !request->cut_status ? request->status : is_slow ? 408 : STATUS_CLIENT_LEFT;
	enum metrics_route route = request->route ? request->route->metrics : ROUTE_OTHER;
	if (request->is_head)
		request->bytes = 0; /* those that a GET would send */
	/* Without a method: the headers never came, or libmicrohttpd refused them by itself. */
	if (!request->status && status == 408)
		metrics_count_problem(service->metrics, PROBLEM_READ_TIMEOUT);
	metrics_count_request(service->metrics, route, status, took, request->bytes);
	access_end(request, request->cut_status ? request->cut_status : status); /* it was made, and counts against the key */
	request_log(request, status, took);
	if (request->is_accepted)
		service->in_flight--;
	connection_end(request->socket);
	connection_set_request(request->socket, NULL);
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
	const struct config *config = service->config;
	const unsigned most = (unsigned)config->connections + CONNECTIONS_SURPLUS;
	if (config->tls_cert)
		flags |= MHD_USE_TLS;
	/* Options end where the certificate's would begin when there is none. */
	const enum MHD_OPTION certificate = config->tls_cert ? MHD_OPTION_HTTPS_CERT_CALLBACK2 : MHD_OPTION_END;
	return MHD_start_daemon(flags, 0, on_accept, service, on_access, service, MHD_OPTION_EXTERNAL_LOGGER, on_library_log, NULL,
				MHD_OPTION_SOCK_ADDR, address->ai_addr, MHD_OPTION_URI_LOG_CALLBACK, on_target, service,
				MHD_OPTION_NOTIFY_CONNECTION, on_connection, service, MHD_OPTION_NOTIFY_COMPLETED, on_completed, service,
				MHD_OPTION_CONNECTION_MEMORY_LIMIT, connection_memory(config), MHD_OPTION_CONNECTION_LIMIT,
				most * HTTP_THREADS, MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)IDLE_SECONDS, MHD_OPTION_THREAD_POOL_SIZE,
				(unsigned)HTTP_THREADS, certificate, tls_retrieve, MHD_OPTION_HTTPS_PRIORITIES, TLS_PRIORITIES,
				MHD_OPTION_END);
}

/* A process is often given fewer descriptors than it may have. Where it may not have enough either, fewer connections are served: without a
 * descriptor to spare not even probes could be answered. */
static bool fit_descriptors(struct service *service)
{
	struct rlimit limit;
	const rlim_t beside = CONNECTIONS_SURPLUS + DESCRIPTORS_BESIDE;
	const rlim_t wanted = (rlim_t)service->config->connections * DESCRIPTORS_EACH + beside;
	if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= wanted)
		return true;
	limit.rlim_cur = limit.rlim_max < wanted ? limit.rlim_max : wanted;
	if (setrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur >= wanted)
		return true;
	const unsigned long long files = getrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : 0;
	if (files < beside + DESCRIPTORS_EACH) {
		log_error("the process may open %llu files only, and needs %llu at least (ulimit -n)", files,
			  (unsigned long long)beside + DESCRIPTORS_EACH);
		return false;
	}
	connections_lower(service->connections, (files - beside) / DESCRIPTORS_EACH);
	log_warning("--connections %d: the process may open %llu files only, so %zu connections are served", service->config->connections,
		    files, connections_total(service->connections));
	return true;
}

bool http_start(struct service *service)
{
	if (!fit_descriptors(service))
		return false;
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
