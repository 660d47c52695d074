/* The log: what a line of JSON may hold. */
#include "renderer/log.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <jansson.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static void assert_string_is(const char *text, const char *expected)
{
	char string[256];
	const size_t length = log_json_string(text, string, sizeof string);
	assert_string_equal(string, expected);
	assert_int_equal(length, strlen(expected));
}

static void strings_are_escaped(void **state)
{
	(void)state;
	assert_string_is("", "\"\"");
	assert_string_is("/v1/render", "\"/v1/render\"");
	assert_string_is("a\"b\\c", "\"a\\\"b\\\\c\"");
	assert_string_is("\n\x1b[31m\x7f", "\"\\u000a\\u001b[31m\\u007f\"");
	assert_string_is("n\xc3\xb6rd \xe2\x82\xac \xf0\x9f\x8c\xa5", "\"n\xc3\xb6rd \xe2\x82\xac \xf0\x9f\x8c\xa5\"");
}

/* Unicode 15, table 3-7 and its examples of what is none: every byte of it is replaced. */
static void what_is_no_utf8_is_replaced(void **state)
{
	(void)state;
	static const char *const bad[] = {"\xff",         "\xc3",        "\xc0\xaf",         "\xe0\x80\xaf",
					  "\xed\xa0\x80", "\xe2\x82",    "\xf4\x90\x80\x80", "\xf0\x80\x80\x80",
					  "\xf5\x80",     "\x80\x80\x80"};
	for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
		char expected[64] = "\"";
		for (size_t byte = 0; byte < strlen(bad[i]); byte++)
			strcat(expected, "\xef\xbf\xbd");
		strcat(expected, "\"");
		assert_string_is(bad[i], expected);
	}
}

/* Jansson reads what was written, also where it was cut. */
static void strings_are_cut_between_characters(void **state)
{
	(void)state;
	static const char text[] = "a\"\n\xe2\x82\xac\xf0\x9f\x8c\xa5z";
	for (size_t size = 3; size <= LOG_JSON_STRING_SIZE(sizeof text - 1); size++) {
		char string[LOG_JSON_STRING_SIZE(sizeof text - 1)];
		const size_t length = log_json_string(text, string, size);
		assert_true(length < size);
		json_t *read = json_loads(string, JSON_DECODE_ANY, NULL);
		assert_non_null(read);
		assert_memory_equal(json_string_value(read), text, json_string_length(read));
		json_decref(read);
	}
}

/* What log_line writes while standard error is a file. */
static void write_line(char *line, size_t size, enum log_format format, const char *message)
{
	FILE *file = tmpfile();
	const int kept = dup(STDERR_FILENO);
	assert_non_null(file);
	fflush(stderr);
	dup2(fileno(file), STDERR_FILENO);
	log_set_format(format);
	log_line(LOG_WARNING, "%s", message);
	log_set_format(LOG_TEXT);
	dup2(kept, STDERR_FILENO);
	close(kept);
	rewind(file);
	line[fread(line, 1, size - 1, file)] = '\0';
	fclose(file);
}

static void lines_in_both_formats(void **state)
{
	(void)state;
	static char line[1 << 15], longest[4096];
	write_line(line, sizeof line, LOG_TEXT, "one\ntwo \"three\"");
	assert_non_null(strstr(line, "Z warning one two \"three\"\n"));
	assert_ptr_equal(strchr(line, '\n'), line + strlen(line) - 1);

	write_line(line, sizeof line, LOG_JSON, "one\ntwo \"three\"");
	json_t *object = json_loads(line, JSON_REJECT_DUPLICATES, NULL);
	assert_non_null(object);
	assert_int_equal(json_object_size(object), 3);
	assert_string_equal(json_string_value(json_object_get(object, "level")), "warning");
	assert_string_equal(json_string_value(json_object_get(object, "message")), "one\ntwo \"three\"");
	json_decref(object);

	memset(longest, '\x01', sizeof longest - 1);
	write_line(line, sizeof line, LOG_JSON, longest);
	object = json_loads(line, 0, NULL);
	assert_non_null(object);
	assert_int_equal(json_string_length(json_object_get(object, "message")), 2047);
	json_decref(object);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(strings_are_escaped),
		cmocka_unit_test(what_is_no_utf8_is_replaced),
		cmocka_unit_test(strings_are_cut_between_characters),
		cmocka_unit_test(lines_in_both_formats),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
