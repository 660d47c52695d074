/* One connection of a load generator: a request out, its answer in, without waiting. It reads no more of an answer than a load needs
 * (status, length, Server-Timing) and throws the body away in the kernel, so that it costs little beside what it measures. HTTP/1.1 without
 * TLS. One thread.
 */
#ifndef STRATUS_CLIENTS_BENCH_CONNECTION_H
#define STRATUS_CLIENTS_BENCH_CONNECTION_H

#include "clients/bench/mix.h"

#include <netdb.h>

enum { CONNECTION_HEAD_MAX = 16384 };

enum connection_state {
	CONNECTION_CLOSED,
	CONNECTION_CONNECTING,
	CONNECTION_SENDING,
	CONNECTION_RECEIVING,
	CONNECTION_IDLE /* open, without a request */
};

enum connection_event {
	CONNECTION_GOES_ON,
	CONNECTION_ANSWERED,
	CONNECTION_STALE,   /* a used connection was closed before the request could be heard: ask again on a new one */
	CONNECTION_REFUSED, /* no connection */
	CONNECTION_BROKEN,  /* closed or reset within an answer or before it */
	CONNECTION_CONFUSED /* what came is no HTTP */
};

struct connection {
	enum connection_state state;
	int fd;
	struct mix_request request; /* kept until connection_finish_request */
	int64_t planned_ns;
	bool measured; /* the load's own mark: counts in its result */

	size_t sent;
	unsigned answers; /* before this one */
	char head[CONNECTION_HEAD_MAX];
	size_t head_size; /* received of head */
	uint64_t body_left;
	bool body_chunked, body_to_end, closes;

	/* Of the answer. */
	int status;
	uint64_t bytes; /* of its body */
	char server_timing[1024];
};

/* Starts with a request, which is taken over; a closed connection is opened first. CONNECTION_GOES_ON or CONNECTION_REFUSED. */
enum connection_event connection_start(struct connection *connection, const struct addrinfo *address, struct mix_request *request);

/* Sends what can be sent at once of a request that was just started. There cannot be an answer yet, and so none is looked for: epoll's edge
 * will tell of it. CONNECTION_GOES_ON. */
enum connection_event connection_ask(struct connection *connection);

/* Does all that can be done at once, so that the next change of the socket (epoll's edge) is worth a call. After CONNECTION_ANSWERED the
 * connection is idle, or closed when the server wished so; after CONNECTION_GOES_ON more is to come; else it is closed. */
enum connection_event connection_advance(struct connection *connection);

/* Has the server closed a connection that is idle? */
bool connection_is_dead(const struct connection *connection);

void connection_finish_request(struct connection *connection);
void connection_close(struct connection *connection);

#endif
