#include "server/connections.h"

#include "renderer/log.h"
#include "server/clock.h"
#include "server/lingering.h"

#include <errno.h>
#include <linux/sockios.h>
#include <linux/tcp.h>
#include <math.h>
#include <netinet/in.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

enum { TICK_MS = 100, SHOW_MS = 10, EVENTS_MAX = 64 };

/* Between two requests; from a first byte to the last; from then to the last byte of the answer; likewise, while others work. */
enum phase { PHASE_IDLE, PHASE_READING, PHASE_WORKING, PHASE_WATCHED };

struct address {
	struct address *next;
	size_t count;
	char key[CLIENT_KEY_SIZE];
};

struct connection {
	struct connections *owner;
	struct connection *next, **link;
	struct address *address;
	uint64_t id; /* of its events: a descriptor may be another connection's when they are read */
	int fd;
	enum phase phase;
	bool is_surplus;
	struct request *request;
	double begun_ms, limit_ms, body_ms; /* first byte of the request; its end at the latest; the end of its headers */
	size_t received;
	uint64_t bytes_before; /* that had come when the last request ended */
	bool is_ending;        /* the client's end came before the request's */
	_Atomic bool is_gone, is_slow, lingers;
};

struct connections {
	struct connections_params params;
	pthread_mutex_t mutex;
	struct connection *first;
	struct address *addresses;
	struct connections_counts counts;
	struct lingering *lingering;
	uint64_t last_id;
	int epoll, wake;
	bool has_thread;
	_Atomic bool stopping;
	pthread_t thread;
};

/* --- the watching thread ---------------------------------------------------------------------------------------------------------- */

/* The request behind may not have so much as a name yet. */
static void refuse_slowness(const struct connection *connection)
{
	static const char body[] =
		"{\n  \"type\": \"urn:stratus:problem:request-timeout\",\n  \"title\": \"The request came too slowly\",\n"
		"  \"status\": 408,\n  \"detail\": \"The request was not complete in time (--read-timeout-s).\"\n}";
	static const char head[] = "HTTP/1.1 408 Request Timeout\r\nContent-Type: application/problem+json\r\nCache-Control: no-store\r\n"
				   "Connection: close\r\nContent-Length: ";
	char answer[sizeof head + sizeof body + 32];
	if (connection->lingers || connection->owner->params.is_encrypted)
		return; /* answered before; or a TLS session, in which this thread has no part */
	const int length = snprintf(answer, sizeof answer, "%s%zu\r\n\r\n%s", head, sizeof body - 1, body);
	if (send(connection->fd, answer, (size_t)length, MSG_NOSIGNAL | MSG_DONTWAIT) < 0)
		log_debug("a slow client could not be answered");
}

/* Zeros when this is no TCP. */
static struct tcp_info ask_system(const struct connection *connection)
{
	struct tcp_info info = {0};
	socklen_t size = sizeof info;
	if (getsockopt(connection->fd, IPPROTO_TCP, TCP_INFO, &info, &size) != 0)
		memset(&info, 0, sizeof info);
	return info;
}

/* All that ever came. */
static uint64_t bytes_come(const struct connection *connection)
{
	return ask_system(connection).tcpi_bytes_received;
}

static void begin_reading(struct connection *connection)
{
	const double now_ms = clock_now_ms(), limit_ms = now_ms + connection->owner->params.read_ms;
	connection->phase = PHASE_READING;
	connection->begun_ms = now_ms;
	connection->received = 0;
	connection->is_ending = false;
	connection->limit_ms = connection->is_surplus ? fmin(connection->limit_ms, limit_ms) : limit_ms;
}

/* libmicrohttpd finds the connection closed and clears it away. */
static void close_slow(struct connections *connections)
{
	const double now_ms = clock_now_ms();
	for (struct connection *connection = connections->first; connection; connection = connection->next) {
		/* What libmicrohttpd had read before the event could be fetched brought none. */
		if (connection->phase == PHASE_IDLE && bytes_come(connection) > connection->bytes_before)
			begin_reading(connection);
		const bool reads = connection->phase == PHASE_READING, waits = connection->phase == PHASE_IDLE && connection->is_surplus;
		if (!(reads || waits) || now_ms < connection->limit_ms)
			continue;
		/* First of all: as soon as the socket is shut libmicrohttpd's thread ends the request and asks why. */
		connection->is_slow = true;
		connection->phase = PHASE_WORKING;
		connections->counts.slow++;
		if (reads)
			refuse_slowness(connection);
		shutdown(connection->fd, SHUT_RDWR);
	}
}

/* After a read that left its buffer room libmicrohttpd waits for another event (it polls at edges), and an end that came with those bytes
 * brings none. Nothing more can come of a socket that the client has ended, so that closing this direction, too, changes nothing; but it is
 * an event. One may be spent on bytes that are still to be read, therefore as often as it takes. Returns whether there are such
 * connections. */
static bool show_ends(struct connections *connections)
{
	bool some = false;
	for (struct connection *connection = connections->first; connection; connection = connection->next) {
		if (connection->phase != PHASE_READING || !connection->is_ending)
			continue;
		shutdown(connection->fd, SHUT_RD);
		some = true;
	}
	return some;
}

/* Asks for one event. What stood there before is forgotten. */
static void ask_for(const struct connection *connection, int operation, uint32_t events)
{
	struct epoll_event event = {.events = events | EPOLLONESHOT, .data.u64 = connection->id};
	if (epoll_ctl(connection->owner->epoll, operation, connection->fd, &event) != 0)
		log_debug("a connection cannot be watched: %s", strerror(errno));
}

static struct connection *find(const struct connections *connections, uint64_t id)
{
	struct connection *connection = connections->first;
	while (connection && connection->id != id)
		connection = connection->next;
	return connection;
}

static void take_event(struct connections *connections, const struct epoll_event *event)
{
	struct connection *connection = find(connections, event->data.u64);
	if (!connection)
		return;
	if (connection->phase == PHASE_IDLE && (event->events & EPOLLIN))
		begin_reading(connection);
	if (connection->phase == PHASE_READING && (event->events & EPOLLRDHUP))
		connection->is_ending = true;
	else if (connection->phase == PHASE_READING)
		ask_for(connection, EPOLL_CTL_MOD, EPOLLRDHUP);
	if (connection->phase == PHASE_WATCHED && (event->events & (EPOLLRDHUP | EPOLLHUP | EPOLLERR)))
		connection->is_gone = true;
}

static void *watch(void *context)
{
	struct connections *connections = context;
	struct epoll_event events[EVENTS_MAX];
	double last_tick_ms = 0;
	bool some_end = false;
	while (!connections->stopping) {
		const int count = epoll_wait(connections->epoll, events, EVENTS_MAX, some_end ? SHOW_MS : TICK_MS);
		bool gone = false;
		pthread_mutex_lock(&connections->mutex);
		for (int i = 0; i < count; i++) {
			take_event(connections, &events[i]);
			gone |= (events[i].events & (EPOLLRDHUP | EPOLLHUP | EPOLLERR)) != 0;
		}
		const bool late = clock_now_ms() >= last_tick_ms + TICK_MS;
		if (late)
			close_slow(connections);
		some_end = show_ends(connections);
		pthread_mutex_unlock(&connections->mutex);
		lingering_work(connections->lingering);
		if (!late && !gone)
			continue;
		last_tick_ms = clock_now_ms();
		connections->params.tick(connections->params.context);
	}
	return NULL;
}

/* --- life ------------------------------------------------------------------------------------------------------------------------- */

/* By events that are of no connection. */
static bool wakes_by(const struct connections *connections, int fd)
{
	struct epoll_event event = {.events = EPOLLIN};
	return epoll_ctl(connections->epoll, EPOLL_CTL_ADD, fd, &event) == 0;
}

struct connections *connections_create(const struct connections_params *params)
{
	struct connections *connections = calloc(1, sizeof *connections);
	if (!connections) {
		log_error("connections_create: out of memory");
		return NULL;
	}
	connections->params = *params;
	pthread_mutex_init(&connections->mutex, NULL);
	connections->epoll = epoll_create1(EPOLL_CLOEXEC);
	connections->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	connections->lingering = lingering_create();
	if (connections->epoll >= 0 && connections->wake >= 0 && connections->lingering && wakes_by(connections, connections->wake) &&
	    wakes_by(connections, lingering_fd(connections->lingering)))
		connections->has_thread = pthread_create(&connections->thread, NULL, watch, connections) == 0;
	if (connections->has_thread)
		return connections;
	log_error("connections_create: %s", strerror(errno));
	connections_destroy(connections);
	return NULL;
}

void connections_stop(struct connections *connections)
{
	if (!connections || !connections->has_thread)
		return;
	const uint64_t one = 1;
	connections->stopping = true;
	if (write(connections->wake, &one, sizeof one) < 0)
		log_debug("connections_stop: %s", strerror(errno));
	pthread_join(connections->thread, NULL);
	connections->has_thread = false;
}

void connections_destroy(struct connections *connections)
{
	if (!connections)
		return;
	connections_stop(connections);
	lingering_destroy(connections->lingering);
	if (connections->epoll >= 0)
		close(connections->epoll);
	if (connections->wake >= 0)
		close(connections->wake);
	pthread_mutex_destroy(&connections->mutex);
	free(connections);
}

struct connections_counts connections_count(struct connections *connections)
{
	pthread_mutex_lock(&connections->mutex);
	const struct connections_counts counts = connections->counts;
	pthread_mutex_unlock(&connections->mutex);
	return counts;
}

size_t connections_total(const struct connections *connections)
{
	return connections->params.total;
}

void connections_lower(struct connections *connections, size_t total)
{
	pthread_mutex_lock(&connections->mutex);
	if (total < connections->params.total)
		connections->params.total = total;
	pthread_mutex_unlock(&connections->mutex);
}

/* --- of whom ---------------------------------------------------------------------------------------------------------------------- */

static struct address *find_address(const struct connections *connections, const char *key)
{
	struct address *address = connections->addresses;
	while (address && strcmp(address->key, key) != 0)
		address = address->next;
	return address;
}

static struct address *take_address(struct connections *connections, const struct sockaddr *from)
{
	char key[CLIENT_KEY_SIZE];
	client_address_key(from, key);
	struct address *address = find_address(connections, key);
	if (!address) {
		address = calloc(1, sizeof *address);
		if (!address)
			return NULL;
		memcpy(address->key, key, sizeof key);
		address->next = connections->addresses;
		connections->addresses = address;
	}
	address->count++;
	return address;
}

static void release_address(struct connections *connections, struct address *address)
{
	struct address **link = &connections->addresses;
	if (--address->count > 0)
		return;
	while (*link != address)
		link = &(*link)->next;
	*link = address->next;
	free(address);
}

bool connections_accept(struct connections *connections, const struct sockaddr *from)
{
	char key[CLIENT_KEY_SIZE];
	client_address_key(from, key);
	pthread_mutex_lock(&connections->mutex);
	const struct address *address = find_address(connections, key);
	const bool accepted = connections->counts.open < connections->params.total + CONNECTIONS_SURPLUS &&
			      (!address || address->count < connections->params.per_address + CONNECTIONS_SURPLUS_PER_ADDRESS);
	connections->counts.refused += !accepted;
	pthread_mutex_unlock(&connections->mutex);
	return accepted;
}

/* --- one of them ------------------------------------------------------------------------------------------------------------------ */

static void insert(struct connections *connections, struct connection *connection)
{
	connection->next = connections->first;
	connection->link = &connections->first;
	if (connection->next)
		connection->next->link = &connection->next;
	connections->first = connection;
	connections->counts.open++;
}

struct connection *connection_open(struct connections *connections, int fd, const struct sockaddr *from)
{
	struct connection *connection = calloc(1, sizeof *connection);
	if (!connection)
		return NULL;
	pthread_mutex_lock(&connections->mutex);
	connection->owner = connections;
	connection->fd = fd;
	connection->id = ++connections->last_id;
	connection->address = take_address(connections, from);
	insert(connections, connection);
	connection->is_surplus = connections->counts.open > connections->params.total ||
				 (connection->address && connection->address->count > connections->params.per_address);
	connections->counts.surplus += connection->is_surplus;
	connection->limit_ms = clock_now_ms() + CONNECTION_SURPLUS_MS;
	ask_for(connection, EPOLL_CTL_ADD, EPOLLIN | EPOLLRDHUP);
	pthread_mutex_unlock(&connections->mutex);
	return connection;
}

void connection_close(struct connection *connection)
{
	if (!connection)
		return;
	struct connections *connections = connection->owner;
	pthread_mutex_lock(&connections->mutex);
	epoll_ctl(connections->epoll, EPOLL_CTL_DEL, connection->fd, NULL);
	if (connection->lingers)
		lingering_take(connections->lingering, connection->fd);
	*connection->link = connection->next;
	if (connection->next)
		connection->next->link = connection->link;
	connections->counts.open--;
	if (connection->address)
		release_address(connections, connection->address);
	pthread_mutex_unlock(&connections->mutex);
	free(connection);
}

double connection_begin(struct connection *connection)
{
	if (!connection)
		return clock_now_ms();
	pthread_mutex_lock(&connection->owner->mutex);
	if (connection->phase == PHASE_IDLE)
		begin_reading(connection);
	const double begun_ms = connection->begun_ms;
	pthread_mutex_unlock(&connection->owner->mutex);
	return begun_ms;
}

static void set_phase(struct connection *connection, enum phase phase)
{
	if (!connection)
		return;
	pthread_mutex_lock(&connection->owner->mutex);
	connection->phase = phase;
	if (phase == PHASE_IDLE)
		connection->bytes_before = bytes_come(connection);
	if (phase == PHASE_IDLE)
		ask_for(connection, EPOLL_CTL_MOD, EPOLLIN | EPOLLRDHUP);
	if (phase == PHASE_WATCHED)
		ask_for(connection, EPOLL_CTL_MOD, EPOLLRDHUP);
	pthread_mutex_unlock(&connection->owner->mutex);
}

static void extend(struct connection *connection)
{
	if (connection->phase != PHASE_READING)
		return;
	const double allowed_ms = connection->owner->params.read_ms + 1e3 * (double)connection->received / CONNECTION_BODY_RATE;
	connection->limit_ms = connection->body_ms + allowed_ms;
}

void connection_expect_body(struct connection *connection)
{
	if (!connection)
		return;
	pthread_mutex_lock(&connection->owner->mutex);
	connection->body_ms = clock_now_ms();
	extend(connection);
	pthread_mutex_unlock(&connection->owner->mutex);
}

void connection_receive(struct connection *connection, size_t bytes)
{
	if (!connection)
		return;
	pthread_mutex_lock(&connection->owner->mutex);
	connection->received += bytes;
	extend(connection);
	pthread_mutex_unlock(&connection->owner->mutex);
}

void connection_work(struct connection *connection)
{
	set_phase(connection, PHASE_WORKING);
}

void connection_watch(struct connection *connection)
{
	set_phase(connection, PHASE_WATCHED);
}

void connection_end(struct connection *connection)
{
	set_phase(connection, PHASE_IDLE);
}

void connection_linger(struct connection *connection)
{
	if (connection)
		connection->lingers = true;
}

uint64_t connection_written(const struct connection *connection)
{
	int unacknowledged = 0;
	if (!connection || ioctl(connection->fd, SIOCOUTQ, &unacknowledged) != 0)
		return 0;
	return connection_acknowledged(connection) + (uint64_t)unacknowledged;
}

uint64_t connection_acknowledged(const struct connection *connection)
{
	return connection ? ask_system(connection).tcpi_bytes_acked : 0;
}

void connection_set_request(struct connection *connection, struct request *request)
{
	if (connection)
		connection->request = request;
}

struct request *connection_request(const struct connection *connection)
{
	return connection ? connection->request : NULL;
}

const char *connection_client(const struct connection *connection)
{
	return connection && connection->address ? connection->address->key : "local";
}

bool connection_is_surplus(const struct connection *connection)
{
	return connection && connection->is_surplus;
}

bool connection_is_gone(const struct connection *connection)
{
	return connection && connection->is_gone;
}

bool connection_is_slow(const struct connection *connection)
{
	return connection && connection->is_slow;
}
