#include "clients/bench/connection.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <unistd.h>

void connection_finish_request(struct connection *connection)
{
	mix_request_finish(&connection->request);
}

void connection_close(struct connection *connection)
{
	if (connection->state != CONNECTION_CLOSED)
		close(connection->fd);
	connection->state = CONNECTION_CLOSED;
	connection->answers = 0;
}

static bool is_pending(int error)
{
	return error == EAGAIN || error == EWOULDBLOCK || error == EINTR || error == EINPROGRESS;
}

static bool open_socket(struct connection *connection, const struct addrinfo *address)
{
	connection->fd = socket(address->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	if (connection->fd < 0)
		return false;
	setsockopt(connection->fd, IPPROTO_TCP, TCP_NODELAY, &(int){1}, sizeof(int));
	connection->state = CONNECTION_CONNECTING;
	if (connect(connection->fd, address->ai_addr, address->ai_addrlen) == 0)
		connection->state = CONNECTION_SENDING;
	else if (!is_pending(errno)) {
		connection_close(connection);
		return false;
	}
	return true;
}

enum connection_event connection_start(struct connection *connection, const struct addrinfo *address, struct mix_request *request)
{
	connection->request = *request;
	*request = (struct mix_request){.shared = true};
	connection->sent = connection->head_size = 0;
	connection->body_left = connection->bytes = 0;
	connection->body_chunked = connection->body_to_end = connection->closes = false;
	connection->status = 0;
	connection->server_timing[0] = '\0';
	if (connection->state == CONNECTION_IDLE)
		connection->state = CONNECTION_SENDING;
	else if (!open_socket(connection, address))
		return CONNECTION_REFUSED;
	return CONNECTION_GOES_ON;
}

bool connection_is_dead(const struct connection *connection)
{
	char byte;
	const ssize_t got = recv(connection->fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
	return got >= 0 || !is_pending(errno); /* bytes that nobody asked for are no good sign either */
}

static enum connection_event fail(struct connection *connection, enum connection_event event)
{
	connection_close(connection);
	return event;
}

/* A server may close a connection that rests at any time: what was then sent on it was not heard. */
static enum connection_event fail_of_peer(struct connection *connection)
{
	const bool unheard = connection->answers > 0 && connection->head_size == 0 && connection->status == 0;
	return fail(connection, unheard ? CONNECTION_STALE : CONNECTION_BROKEN);
}

/* --- the head of an answer ------------------------------------------------------------------------------------------------------- */

/* The value of a header line (not ended by a NUL), NULL when it is another's. */
static const char *value_of(const char *line, const char *end, const char *name)
{
	const size_t length = strlen(name);
	if ((size_t)(end - line) <= length || strncasecmp(line, name, length) != 0 || line[length] != ':')
		return NULL;
	line += length + 1;
	while (line < end && (*line == ' ' || *line == '\t'))
		line++;
	return line;
}

/* Several such headers are one list. */
static void keep_timing(struct connection *connection, const char *value, const char *end)
{
	size_t used = strlen(connection->server_timing), room = sizeof connection->server_timing - used;
	const size_t length = (size_t)(end - value);
	if (used > 0 && room > 1) {
		connection->server_timing[used++] = ',';
		room--;
	}
	if (length < room) {
		memcpy(connection->server_timing + used, value, length);
		connection->server_timing[used + length] = '\0';
	}
}

static void take_line(struct connection *connection, const char *line, const char *end)
{
	const char *value;
	if ((value = value_of(line, end, "Content-Length"))) {
		connection->body_left = strtoull(value, NULL, 10);
		connection->body_to_end = false;
	} else if ((value = value_of(line, end, "Server-Timing"))) {
		keep_timing(connection, value, end);
	} else if ((value = value_of(line, end, "Connection"))) {
		connection->closes = end - value >= 5 && strncasecmp(value, "close", 5) == 0;
	} else if ((value = value_of(line, end, "Transfer-Encoding"))) {
		connection->body_chunked = true;
		connection->body_to_end = false;
	}
}

/* Reads the whole head, which ends at `end`; false when it is none. */
static bool take_head(struct connection *connection, char *end)
{
	const char *head = connection->head;
	if (end - head < 12 || strncmp(head, "HTTP/1.", 7) != 0 || head[8] != ' ')
		return false;
	connection->status = atoi(head + 9);
	connection->body_to_end = connection->status >= 200 && connection->status != 204 && connection->status != 304;
	for (const char *line = memchr(head, '\n', (size_t)(end - head)); line && line + 1 < end;) {
		const char *next = memchr(line + 1, '\n', (size_t)(end - line - 1));
		const char *stop = next ? next : end;
		take_line(connection, line + 1, stop > line + 1 && stop[-1] == '\r' ? stop - 1 : stop);
		line = next;
	}
	connection->closes |= connection->body_to_end;
	return connection->status >= 100 && connection->status <= 599;
}

/* --- receiving --------------------------------------------------------------------------------------------------------------------- */

static enum connection_event answered(struct connection *connection)
{
	connection->answers++;
	connection->state = CONNECTION_IDLE;
	if (connection->closes)
		connection_close(connection);
	return CONNECTION_ANSWERED;
}

/* The size line of the chunk that head holds, and its end; NULL when it is not whole yet. */
static char *chunk_line_end(struct connection *connection)
{
	connection->head[connection->head_size] = '\0';
	return strstr(connection->head, "\r\n");
}

static void drop_head(struct connection *connection, size_t size)
{
	connection->head_size -= size;
	memmove(connection->head, connection->head + size, connection->head_size);
}

/* What head holds of a chunked body. CONNECTION_GOES_ON: more is needed. */
static enum connection_event take_chunks(struct connection *connection)
{
	for (;;) {
		const uint64_t here = connection->body_left < connection->head_size ? connection->body_left : connection->head_size;
		drop_head(connection, (size_t)here);
		connection->body_left -= here;
		char *end = connection->body_left ? NULL : chunk_line_end(connection);
		if (!end)
			return CONNECTION_GOES_ON;
		char *digits_end;
		const uint64_t size = strtoull(connection->head, &digits_end, 16);
		if (digits_end == connection->head)
			return fail(connection, CONNECTION_CONFUSED);
		drop_head(connection, (size_t)(end + 2 - connection->head));
		connection->bytes += size;
		connection->body_left = size + 2; /* and its line's end */
		if (size == 0) {
			connection->closes = true; /* what may follow the last chunk is not read */
			return answered(connection);
		}
	}
}

/* Reads into head. Positive: so many bytes; 0: the end; negative: none yet, or (errno) an error. */
static ssize_t receive_head(struct connection *connection)
{
	const size_t room = sizeof connection->head - 1 - connection->head_size;
	const ssize_t got = recv(connection->fd, connection->head + connection->head_size, room, 0);
	if (got > 0)
		connection->head_size += (size_t)got;
	return got;
}

/* A body of known length is dropped without a copy. */
static enum connection_event drop_body(struct connection *connection)
{
	enum { PIECE = 1 << 20 };
	while (connection->body_left > 0 || connection->body_to_end) {
		const size_t wanted = connection->body_to_end || connection->body_left > PIECE ? PIECE : (size_t)connection->body_left;
		const ssize_t got = recv(connection->fd, NULL, wanted, MSG_TRUNC);
		if (got == 0 && connection->body_to_end)
			return answered(connection);
		if (got < 0 && is_pending(errno))
			return CONNECTION_GOES_ON;
		if (got <= 0)
			return fail(connection, CONNECTION_BROKEN);
		if (connection->body_to_end)
			connection->bytes += (uint64_t)got;
		else
			connection->body_left -= (uint64_t)got;
	}
	return answered(connection);
}

/* The head is whole: what follows it in the buffer is body. */
static enum connection_event begin_body(struct connection *connection, char *end)
{
	if (!take_head(connection, end))
		return fail(connection, CONNECTION_CONFUSED);
	drop_head(connection, (size_t)(end - connection->head));
	if (connection->status < 200) { /* one before the answer */
		connection->status = 0;
		connection->body_left = 0;
		return CONNECTION_GOES_ON;
	}
	if (connection->body_chunked) {
		connection->body_left = 0;
		return take_chunks(connection);
	}
	if (connection->body_to_end) {
		connection->bytes = connection->head_size;
		return drop_body(connection);
	}
	if (connection->head_size > connection->body_left)
		return fail(connection, CONNECTION_CONFUSED);
	connection->bytes = connection->body_left;
	connection->body_left -= connection->head_size;
	return drop_body(connection);
}

static enum connection_event receive(struct connection *connection)
{
	if (connection->status && !connection->body_chunked)
		return drop_body(connection);
	for (;;) {
		const ssize_t got = receive_head(connection);
		if (got < 0 && is_pending(errno))
			return CONNECTION_GOES_ON;
		if (got <= 0)
			return fail_of_peer(connection);
		enum connection_event event = CONNECTION_GOES_ON;
		char *end;
		connection->head[connection->head_size] = '\0';
		if (connection->status)
			event = take_chunks(connection);
		else
			while (event == CONNECTION_GOES_ON && !connection->status && (end = strstr(connection->head, "\r\n\r\n"))) {
				event = begin_body(connection, end + 4);
				connection->head[connection->head_size] = '\0';
				if (connection->status && !connection->body_chunked)
					return event;
			}
		if (event != CONNECTION_GOES_ON)
			return event;
		if (connection->head_size + 1 == sizeof connection->head)
			return fail(connection, CONNECTION_CONFUSED); /* a head without end */
	}
}

/* --- sending ----------------------------------------------------------------------------------------------------------------------- */

static enum connection_event finish_connecting(struct connection *connection)
{
	int error = 0;
	socklen_t size = sizeof error;
	struct sockaddr_storage peer;
	socklen_t peer_size = sizeof peer;
	if (getsockopt(connection->fd, SOL_SOCKET, SO_ERROR, &error, &size) != 0 || error)
		return fail(connection, CONNECTION_REFUSED);
	if (getpeername(connection->fd, (struct sockaddr *)&peer, &peer_size) == 0)
		connection->state = CONNECTION_SENDING;
	return CONNECTION_GOES_ON;
}

static enum connection_event send_request(struct connection *connection)
{
	while (connection->sent < connection->request.size) {
		const ssize_t put = send(connection->fd, connection->request.bytes + connection->sent,
					 connection->request.size - connection->sent, MSG_NOSIGNAL);
		if (put < 0 && is_pending(errno))
			return CONNECTION_GOES_ON;
		if (put < 0)
			/* A server may answer and close before it has read all. */
			break;
		connection->sent += (size_t)put;
	}
	connection->state = CONNECTION_RECEIVING;
	return CONNECTION_GOES_ON;
}

enum connection_event connection_ask(struct connection *connection)
{
	return connection->state == CONNECTION_SENDING ? send_request(connection) : CONNECTION_GOES_ON;
}

enum connection_event connection_advance(struct connection *connection)
{
	enum connection_event event = CONNECTION_GOES_ON;
	if (connection->state == CONNECTION_CONNECTING)
		event = finish_connecting(connection);
	if (connection->state == CONNECTION_SENDING)
		event = send_request(connection);
	if (connection->state == CONNECTION_RECEIVING)
		event = receive(connection);
	return event;
}
