#include "server/lingering.h"

#include "server/clock.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

/* Read at once of one socket, so that none keeps the others waiting. */
enum { PIECE_BYTES = 1 << 20, PIECES_MAX = 4 };

struct guest {
	int socket; /* negative: a free place */
	double until_ms, last_ms;
};

struct lingering {
	pthread_mutex_t mutex;
	int epoll;
	size_t count;
	struct guest guests[LINGERING_MAX];
};

struct lingering *lingering_create(void)
{
	struct lingering *lingering = calloc(1, sizeof *lingering);
	if (!lingering)
		return NULL;
	lingering->epoll = epoll_create1(EPOLL_CLOEXEC);
	if (lingering->epoll < 0) {
		free(lingering);
		return NULL;
	}
	pthread_mutex_init(&lingering->mutex, NULL);
	for (int i = 0; i < LINGERING_MAX; i++)
		lingering->guests[i].socket = -1;
	return lingering;
}

static void dismiss(struct lingering *lingering, struct guest *guest)
{
	close(guest->socket);
	guest->socket = -1;
	lingering->count--;
}

void lingering_destroy(struct lingering *lingering)
{
	if (!lingering)
		return;
	for (int i = 0; i < LINGERING_MAX; i++)
		if (lingering->guests[i].socket >= 0)
			dismiss(lingering, &lingering->guests[i]);
	close(lingering->epoll);
	pthread_mutex_destroy(&lingering->mutex);
	free(lingering);
}

int lingering_fd(const struct lingering *lingering)
{
	return lingering->epoll;
}

static struct guest *find_place(struct lingering *lingering)
{
	for (int i = 0; i < LINGERING_MAX; i++)
		if (lingering->guests[i].socket < 0)
			return &lingering->guests[i];
	return NULL;
}

/* Within the mutex. */
static bool admit(struct lingering *lingering, struct guest *guest, int socket)
{
	struct epoll_event event = {.events = EPOLLIN | EPOLLRDHUP, .data.u32 = (uint32_t)(guest - lingering->guests)};
	guest->socket = fcntl(socket, F_DUPFD_CLOEXEC, 0);
	if (guest->socket < 0)
		return false;
	if (epoll_ctl(lingering->epoll, EPOLL_CTL_ADD, guest->socket, &event) != 0) {
		close(guest->socket);
		guest->socket = -1;
		return false;
	}
	guest->last_ms = clock_now_ms();
	guest->until_ms = guest->last_ms + LINGERING_MS;
	lingering->count++;
	return true;
}

bool lingering_take(struct lingering *lingering, int socket)
{
	pthread_mutex_lock(&lingering->mutex);
	struct guest *place = find_place(lingering);
	const bool taken = place && admit(lingering, place, socket);
	pthread_mutex_unlock(&lingering->mutex);
	if (taken)
		shutdown(socket, SHUT_WR);
	return taken;
}

/* MSG_TRUNC: TCP throws the bytes away by itself. false when nothing more will come. */
static bool read_away(struct guest *guest)
{
	ssize_t got = 1;
	for (int i = 0; i < PIECES_MAX && got > 0; i++)
		got = recv(guest->socket, NULL, PIECE_BYTES, MSG_TRUNC | MSG_DONTWAIT);
	guest->last_ms = clock_now_ms();
	return got > 0 || (got < 0 && (errno == EAGAIN || errno == EINTR));
}

void lingering_work(struct lingering *lingering)
{
	struct epoll_event events[LINGERING_MAX];
	pthread_mutex_lock(&lingering->mutex);
	const int count = lingering->count ? epoll_wait(lingering->epoll, events, LINGERING_MAX, 0) : 0;
	for (int i = 0; i < count; i++)
		if (!read_away(&lingering->guests[events[i].data.u32]))
			dismiss(lingering, &lingering->guests[events[i].data.u32]);
	const double now_ms = clock_now_ms();
	for (int i = 0; i < LINGERING_MAX; i++) {
		struct guest *guest = &lingering->guests[i];
		if (guest->socket >= 0 && now_ms >= fmin(guest->until_ms, guest->last_ms + LINGERING_STILL_MS))
			dismiss(lingering, guest);
	}
	pthread_mutex_unlock(&lingering->mutex);
}

size_t lingering_count(struct lingering *lingering)
{
	pthread_mutex_lock(&lingering->mutex);
	const size_t count = lingering->count;
	pthread_mutex_unlock(&lingering->mutex);
	return count;
}
