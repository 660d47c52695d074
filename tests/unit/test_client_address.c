/* Which addresses count as one client. */
#include "server/client_address.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

static void assert_key(const char *address, const char *expected)
{
	char key[CLIENT_KEY_SIZE];
	struct sockaddr_in6 six = {.sin6_family = AF_INET6, .sin6_port = htons(1234)};
	struct sockaddr_in four = {.sin_family = AF_INET, .sin_port = htons(1234)};
	if (inet_pton(AF_INET6, address, &six.sin6_addr) == 1) {
		client_address_key((const struct sockaddr *)&six, key);
	} else {
		assert_int_equal(inet_pton(AF_INET, address, &four.sin_addr), 1);
		client_address_key((const struct sockaddr *)&four, key);
	}
	assert_string_equal(key, expected);
}

static void keys(void **state)
{
	(void)state;
	assert_key("192.0.2.7", "192.0.2.7");
	assert_key("::ffff:192.0.2.7", "192.0.2.7"); /* the same host by a socket for both */
	assert_key("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64");
	assert_key("2001:db8:1:2:ffff::", "2001:db8:1:2::/64");
	assert_key("2001:db8:1:3::1", "2001:db8:1:3::/64");
	assert_key("ffff:ffff:ffff:ffff:ffff:ffff:ffff:ffff", "ffff:ffff:ffff:ffff::/64");
}

static void what_is_no_address(void **state)
{
	(void)state;
	char key[CLIENT_KEY_SIZE];
	const struct sockaddr local = {.sa_family = AF_UNIX};
	client_address_key(&local, key);
	assert_string_equal(key, "local");
	client_address_key(NULL, key);
	assert_string_equal(key, "local");
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(keys), cmocka_unit_test(what_is_no_address)};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
