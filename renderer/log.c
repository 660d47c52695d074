#include "renderer/log.h"

#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static _Atomic int current_level = LOG_INFO, current_format = LOG_TEXT;

void log_set_level(enum log_level level)
{
	current_level = level;
}

bool log_is_wanted(enum log_level level)
{
	return (int)level <= current_level;
}

void log_set_format(enum log_format format)
{
	current_format = format;
}

enum log_format log_current_format(void)
{
	return (enum log_format)current_format;
}

/* Length of the UTF-8 sequence at the start of a text (Unicode 15, table 3-7: no overlong forms, no surrogates); 0: it is none. */
static size_t sequence_length(const unsigned char *text)
{
	const unsigned char lead = text[0];
	const size_t length = lead < 0x80                   ? 1
			      : lead >= 0xc2 && lead < 0xe0 ? 2
			      : lead >= 0xe0 && lead < 0xf0 ? 3
			      : lead >= 0xf0 && lead < 0xf5 ? 4
							    : 0;
	for (size_t i = 1; i < length; i++)
		if ((text[i] & 0xc0) != 0x80)
			return 0;
	if ((lead == 0xe0 && text[1] < 0xa0) || (lead == 0xed && text[1] > 0x9f) || (lead == 0xf0 && text[1] < 0x90) ||
	    (lead == 0xf4 && text[1] > 0x8f))
		return 0;
	return length;
}

/* What stands in a JSON string for the character at the start of a text; returns how many bytes of the text that is. */
static size_t escape_one(const unsigned char *text, char escaped[8])
{
	const size_t length = sequence_length(text);
	if (length == 0)
		strcpy(escaped, "\xef\xbf\xbd");
	else if (*text == '"' || *text == '\\')
		snprintf(escaped, 8, "\\%c", *text);
	else if (*text < 0x20 || *text == 0x7f)
		snprintf(escaped, 8, "\\u%04x", *text);
	else
		snprintf(escaped, 8, "%.*s", (int)length, (const char *)text);
	return length ? length : 1;
}

size_t log_json_string(const char *text, char *string, size_t size)
{
	size_t used = 0;
	string[used++] = '"';
	for (const unsigned char *c = (const unsigned char *)text; *c;) {
		char escaped[8];
		c += escape_one(c, escaped);
		const size_t length = strlen(escaped);
		if (used + length + 2 > size)
			break;
		memcpy(string + used, escaped, length);
		used += length;
	}
	string[used++] = '"';
	string[used] = '\0';
	return used;
}

void log_record(enum log_level level, const char *content)
{
	static const char *const names[] = {"error", "warning", "info", "debug"};
	if (!log_is_wanted(level))
		return;
	struct timespec now;
	struct tm utc;
	char stamp[32];
	clock_gettime(CLOCK_REALTIME, &now);
	gmtime_r(&now.tv_sec, &utc);
	strftime(stamp, sizeof stamp, "%Y-%m-%dT%H:%M:%S", &utc);
	const long milliseconds = now.tv_nsec / 1000000;
	/* One call, so that lines of several threads do not mix. */
	if (current_format == LOG_JSON)
		fprintf(stderr, "{\"time\":\"%s.%03ldZ\",\"level\":\"%s\",%s}\n", stamp, milliseconds, names[level], content);
	else
		fprintf(stderr, "%s.%03ldZ %-7s %s\n", stamp, milliseconds, names[level], content);
}

static void record_message(enum log_level level, const char *text)
{
	static const char member[] = "\"message\":";
	char content[sizeof member + LOG_JSON_STRING_SIZE(2048)];
	memcpy(content, member, sizeof member - 1);
	log_json_string(text, content + sizeof member - 1, sizeof content - sizeof member + 1);
	log_record(level, content);
}

void log_line(enum log_level level, const char *format, ...)
{
	if (!log_is_wanted(level))
		return;

	char text[2048];
	va_list args;
	va_start(args, format);
	vsnprintf(text, sizeof text, format, args);
	va_end(args);
	if (current_format == LOG_JSON) {
		record_message(level, text);
		return;
	}
	for (char *c = text; *c; c++)
		if ((unsigned char)*c < 0x20 || *c == 0x7f)
			*c = ' ';
	log_record(level, text);
}
