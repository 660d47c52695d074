/* The first line of a request: what can be one, as soon as it can be known, however it is cut into pieces. */
#include "server/request_line.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

/* Bytes up to and with the first wrong one; 0: none is. */
static size_t first_wrong(const char *text, size_t size)
{
	struct request_line line = {0};
	for (size_t i = 0; i < size; i++)
		if (!request_line_take(&line, text + i, 1))
			return i + 1;
	return 0;
}

static void check(const char *text, size_t size, size_t wrong)
{
	struct request_line whole = {0};
	assert_int_equal(request_line_take(&whole, text, size), wrong == 0);
	assert_int_equal(first_wrong(text, size), wrong);
}

#define CHECK(text, wrong) check(text, sizeof text - 1, wrong)

static void test_lines(void **state)
{
	(void)state;
	CHECK("GET / HTTP/1.1\r\nHost: x\r\n\r\n", 0);
	CHECK("\r\n\n\r\nGET / HTTP/1.1\r\n", 0);
	CHECK("m-search!#$%&'*+.^_`|~09 * HTTP/1.1\r\n", 0);
	CHECK("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", 0);
	CHECK("GET /\xc3\xa9 HTTP/1.1\r\n", 0);
	CHECK("GET /\r\n", 0); /* its version is libmicrohttpd's to miss */
	CHECK("GET / HTTP/1.1\r\n\0\1\2", 0);
	CHECK("", 0);
	CHECK("\r\n", 0);
	CHECK("hello\r\n", 6);
	CHECK("hello\n", 6);
	CHECK(" GET / HTTP/1.1\r\n", 1);
	CHECK("\r\n\r\n GET", 5);
	CHECK("GET\t/", 4);
	CHECK("G(T /", 2);
	CHECK("\0\1\2\r\n", 1);
	CHECK("\x16\3\1", 1);
	CHECK("\xc3\xa9 /", 1);
	CHECK("GET /a\0b HTTP/1.1\r\n", 7);
	CHECK("GET /a\x7f HTTP/1.1\r\n", 7);
	CHECK("GET /a\tb HTTP/1.1\r\n", 7);
}

static void test_empty_lines_are_counted(void **state)
{
	(void)state;
	struct request_line line = {0};
	assert_true(request_line_take(&line, "\r\n\r", 3));
	assert_true(request_line_take(&line, "\nGET / HTTP/1.1\r\n\r\n\r\n", 21));
	assert_int_equal(line.empty_bytes, 4);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(test_lines), cmocka_unit_test(test_empty_lines_are_counted)};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
