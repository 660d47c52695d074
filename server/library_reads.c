#include "server/library_reads.h"

#include "renderer/log.h"
#include "server/connections.h"
#include "server/library_answers.h"
#include "server/request_line.h"

#include <dlfcn.h>
#include <gnutls/gnutls.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sys/socket.h>

/* Descriptors from there on are not looked at; there are fewer with the most --connections. */
enum { READINGS_MAX = 1 << 18 };

/* The first byte of a TLS record that begins a session (RFC 8446, 5.1). */
enum { TLS_HANDSHAKE = 0x16 };

struct reading {
	struct service *service;
	struct MHD_Connection *connection;
	struct connection *socket;
	struct request_line line;
	uint64_t bytes; /* since the end of the request before */
	bool is_encrypted, is_lost;
};

static _Atomic(struct reading *) readings[READINGS_MAX];

static ssize_t (*system_recv)(int, void *, size_t, int);
static ssize_t (*tls_recv)(gnutls_session_t, void *, size_t);

static void find_functions(void)
{
	*(void **)&system_recv = dlsym(RTLD_NEXT, "recv");
	*(void **)&tls_recv = dlsym(RTLD_NEXT, "gnutls_record_recv");
	if (system_recv && tls_recv)
		return;
	log_error("there is no recv, or no gnutls_record_recv: %s", dlerror());
	abort();
}

static void find_functions_once(void)
{
	static pthread_once_t once = PTHREAD_ONCE_INIT;
	pthread_once(&once, find_functions);
}

static _Atomic(struct reading *) *place_of_descriptor(int fd)
{
	return fd >= 0 && fd < READINGS_MAX ? &readings[fd] : NULL;
}

static _Atomic(struct reading *) *place_of(struct MHD_Connection *connection)
{
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
	return place_of_descriptor(info ? info->connect_fd : -1);
}

void library_reads_open(struct service *service, struct MHD_Connection *connection, struct connection *socket)
{
	_Atomic(struct reading *) *place = place_of(connection);
	struct reading *reading = place ? calloc(1, sizeof *reading) : NULL;
	if (!reading)
		return;
	reading->service = service;
	reading->connection = connection;
	reading->socket = socket;
	reading->is_encrypted = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_GNUTLS_SESSION) != NULL;
	*place = reading;
}

void library_reads_close(struct MHD_Connection *connection)
{
	_Atomic(struct reading *) *place = place_of(connection);
	if (place)
		free(atomic_exchange(place, NULL));
}

void library_reads_end(struct MHD_Connection *connection, uint64_t bytes)
{
	_Atomic(struct reading *) *place = place_of(connection);
	struct reading *reading = place ? *place : NULL;
	if (!reading)
		return;
	reading->is_lost |= bytes == 0 || bytes + reading->line.empty_bytes != reading->bytes;
	reading->line = (struct request_line){0};
	reading->bytes = 0;
}

struct service *library_reads_service(struct MHD_Connection *connection)
{
	_Atomic(struct reading *) *place = place_of(connection);
	const struct reading *reading = place ? *place : NULL;
	return reading ? reading->service : NULL;
}

/* The client has ended: in the middle of its line? One that was too slow has its answer. */
static bool is_cut(const struct reading *reading)
{
	const bool in_line = reading->line.state == REQUEST_LINE_IN_METHOD || reading->line.state == REQUEST_LINE_IN_TARGET;
	return in_line && !connection_is_slow(reading->socket);
}

/* What the library is told of so many bytes that have come: that they have, or that the client has ended. */
static ssize_t look(int fd, bool is_encrypted, const void *data, ssize_t size)
{
	_Atomic(struct reading *) *place = place_of_descriptor(fd);
	struct reading *reading = place ? *place : NULL;
	if (!reading || reading->is_encrypted != is_encrypted || reading->is_lost || size < 0)
		return size;
	const bool is_first = reading->bytes == 0;
	reading->bytes += (uint64_t)size;
	if (size == 0 ? !is_cut(reading) : request_line_take(&reading->line, data, (size_t)size))
		return size;
	const bool is_tls = size > 0 && is_first && !is_encrypted && *(const unsigned char *)data == TLS_HANDSHAKE;
	reading->is_lost = true;
	library_refuse_line(reading->connection, reading->socket, size == 0 ? LINE_CUT : is_tls ? LINE_OF_TLS : LINE_MALFORMED);
	return 0;
}

/* In place of the C library's, for all of this process. */
ssize_t recv(int fd, void *data, size_t size, int flags)
{
	find_functions_once();
	const ssize_t got = system_recv(fd, data, size, flags);
	return flags & (MSG_PEEK | MSG_TRUNC) ? got : look(fd, false, data, got);
}

/* In place of GnuTLS's. */
ssize_t gnutls_record_recv(gnutls_session_t session, void *data, size_t size)
{
	find_functions_once();
	return look(gnutls_transport_get_int(session), true, data, tls_recv(session, data, size));
}
