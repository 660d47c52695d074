/* The connections that there are: how many of whom, how long each may take to state a request, and whether its client is still there while
 * others work for it.
 *
 * libmicrohttpd lets a connection rest while its request is worked for and does not see then that the client has closed it; and its time
 * limit begins anew with every byte. So a thread of this module watches all sockets beside it, and reads nothing from them:
 * - the first byte of a request is when its deadline begins to count, and from when on it must be complete in time;
 * - a request that is not is answered 408 and its connection is closed;
 * - an end of the client's that comes with a request's last bytes, which libmicrohttpd does not see then, is shown to it again;
 * - a client that closes its end, or only its sending half, while its request is worked for counts as gone: the two look alike (RFC
 * 9112, 9.6 lets a server close then), and whoever wants an answer keeps the connection open.
 *
 * Beyond a limit a connection is surplus: it may ask for probes and metrics alone, must say so within CONNECTION_SURPLUS_MS, and is closed
 * after one answer. Some more than that, and new ones are closed at once.
 */
#ifndef STRATUS_SERVER_CONNECTIONS_H
#define STRATUS_SERVER_CONNECTIONS_H

#include "server/client_address.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CONNECTION_SURPLUS_MS 2000.0
/* Surplus connections that are kept, of all clients and of each. */
enum { CONNECTIONS_SURPLUS = 64, CONNECTIONS_SURPLUS_PER_ADDRESS = 8 };
/* Bytes a second that a body must bring on the average, beyond the time for its first. */
#define CONNECTION_BODY_RATE 16384.0

struct connections;
struct connection;
struct request;

struct connections_params {
	size_t total, per_address; /* from 1 */
	double read_ms;            /* for the headers of a request, and for its body beyond what CONNECTION_BODY_RATE allows */
	bool is_encrypted;         /* by TLS */
	/* Clients have gone, or some time has passed: called again and again by the watching thread. */
	void (*tick)(void *context);
	void *context;
};

struct connections_counts {
	size_t open;
	unsigned long long refused, surplus, slow; /* closed at once; answered as surplus; closed for their slowness */
};

/* Starts the thread. NULL (and a log line) on failure. */
struct connections *connections_create(const struct connections_params *params);
/* Ends the thread; the rest goes on without being watched. */
void connections_stop(struct connections *connections);
/* No connection may be open any more. Takes NULL. */
void connections_destroy(struct connections *connections);

struct connections_counts connections_count(struct connections *connections);

/* Those that are served; lowered to what descriptors there are, before the first one comes. */
size_t connections_total(const struct connections *connections);
void connections_lower(struct connections *connections, size_t total);

/* --- called by the HTTP threads --------------------------------------------------------------------------------------------------- */

/* May a connection from there be made at all? */
bool connections_accept(struct connections *connections, const struct sockaddr *address);

/* One was. NULL when out of memory: it is not watched then. All that follows takes NULL. */
struct connection *connection_open(struct connections *connections, int fd, const struct sockaddr *address);
/* It is about to be closed. */
void connection_close(struct connection *connection);

/* A request has begun. Returns the time of its first byte. */
double connection_begin(struct connection *connection);
/* Its headers are in, or so many bytes more of its body. */
void connection_expect_body(struct connection *connection);
void connection_receive(struct connection *connection, size_t bytes);
/* It is complete, or being answered. */
void connection_work(struct connection *connection);
/* Others work for it, until connection_work: is the client there? */
void connection_watch(struct connection *connection);
/* It was answered; another may follow. */
void connection_end(struct connection *connection);
/* It was answered before its end: what is left of it is still read when the connection closes (lingering.h). */
void connection_linger(struct connection *connection);

/* Bytes that were written to it so far; and those of them that the client's end has acknowledged. 0 when that is not known. */
uint64_t connection_written(const struct connection *connection);
uint64_t connection_acknowledged(const struct connection *connection);

/* What is asked on it now, for whoever has the connection alone. NULL: nothing, or nothing that could be read. */
void connection_set_request(struct connection *connection, struct request *request);
struct request *connection_request(const struct connection *connection);

/* Of the client, for as long as the connection is open. "local" for NULL. */
const char *connection_client(const struct connection *connection);
bool connection_is_surplus(const struct connection *connection);

/* --- any thread, as long as the connection is open -------------------------------------------------------------------------------- */

/* Has the client gone while others worked for it? */
bool connection_is_gone(const struct connection *connection);
/* Was its request answered 408? */
bool connection_is_slow(const struct connection *connection);

#endif
