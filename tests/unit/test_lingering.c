/* Sockets that are read away after their answer. */
#include "server/lingering.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>
// clang-format off
#include <cmocka.h>
// clang-format on

struct pair {
	int server, client;
};

static struct pair connect_pair(int listener)
{
	struct sockaddr_in address;
	socklen_t size = sizeof address;
	struct pair pair;
	assert_int_equal(getsockname(listener, (struct sockaddr *)&address, &size), 0);
	pair.client = socket(AF_INET, SOCK_STREAM, 0);
	assert_int_equal(connect(pair.client, (struct sockaddr *)&address, size), 0);
	pair.server = accept(listener, NULL, NULL);
	assert_true(pair.client >= 0 && pair.server >= 0);
	return pair;
}

static int listen_somewhere(void)
{
	const struct sockaddr_in any = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
	const int listener = socket(AF_INET, SOCK_STREAM, 0);
	assert_int_equal(bind(listener, (const struct sockaddr *)&any, sizeof any), 0);
	assert_int_equal(listen(listener, 8), 0);
	return listener;
}

static void await(struct lingering *lingering)
{
	struct pollfd poll_fd = {.fd = lingering_fd(lingering), .events = POLLIN};
	assert_int_equal(poll(&poll_fd, 1, 60000), 1);
	lingering_work(lingering);
}

/* Far more than sockets hold goes through a socket that the server has closed, and the answer is there. */
static void test_a_client_that_writes_first(void **state)
{
	static char piece[1 << 16];
	struct lingering *lingering = lingering_create();
	const int listener = listen_somewhere();
	const struct pair pair = connect_pair(listener);
	(void)state;
	assert_int_equal(write(pair.server, "answer", 6), 6);
	assert_true(lingering_take(lingering, pair.server));
	close(pair.server);
	assert_int_equal(lingering_count(lingering), 1);
	fcntl(pair.client, F_SETFL, O_NONBLOCK);
	for (size_t sent = 0; sent < 64 << 20;) {
		const ssize_t written = send(pair.client, piece, sizeof piece, MSG_NOSIGNAL);
		assert_true(written > 0 || errno == EAGAIN);
		if (written > 0)
			sent += (size_t)written;
		else
			await(lingering);
	}
	fcntl(pair.client, F_SETFL, 0);
	assert_int_equal(recv(pair.client, piece, sizeof piece, MSG_WAITALL), 6);
	assert_memory_equal(piece, "answer", 6);
	close(pair.client);
	while (lingering_count(lingering))
		await(lingering);
	lingering_destroy(lingering);
	close(listener);
}

static void test_so_many_and_no_more(void **state)
{
	struct lingering *lingering = lingering_create();
	const int listener = listen_somewhere();
	struct pair pairs[LINGERING_MAX + 1];
	(void)state;
	for (int i = 0; i <= LINGERING_MAX; i++) {
		pairs[i] = connect_pair(listener);
		assert_int_equal(lingering_take(lingering, pairs[i].server), i < LINGERING_MAX);
		close(pairs[i].server);
	}
	assert_int_equal(lingering_count(lingering), LINGERING_MAX);
	close(pairs[0].client);
	while (lingering_count(lingering) == LINGERING_MAX)
		await(lingering);
	const struct pair next = connect_pair(listener);
	assert_true(lingering_take(lingering, next.server));
	close(next.server);
	lingering_destroy(lingering); /* the rest is closed */
	char byte;
	assert_int_equal(recv(pairs[1].client, &byte, 1, 0), 0);
	for (int i = 1; i <= LINGERING_MAX; i++)
		close(pairs[i].client);
	close(next.client);
	close(listener);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_client_that_writes_first),
		cmocka_unit_test(test_so_many_and_no_more),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
