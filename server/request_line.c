#include "server/request_line.h"

#include <string.h>

/* Of a token (RFC 9110, 5.6.2). */
static bool is_token_character(char c)
{
	return c > ' ' && c < 0x7f && !strchr("\"(),/:;<=>?@[\\]{}", c);
}

static bool is_control(char c)
{
	return (c >= 0 && c < ' ') || c == 0x7f;
}

static bool take(struct request_line *line, char c)
{
	const bool is_end = c == '\r' || c == '\n';
	if (line->state == REQUEST_LINE_IN_TARGET) {
		line->state = c == '\n' ? REQUEST_LINE_READ : REQUEST_LINE_IN_TARGET;
		return is_end || !is_control(c);
	}
	if (line->state == REQUEST_LINE_AWAITED && is_end) {
		line->empty_bytes++;
		return true;
	}
	const bool is_blank = line->state == REQUEST_LINE_IN_METHOD && c == ' ';
	line->state = is_blank ? REQUEST_LINE_IN_TARGET : REQUEST_LINE_IN_METHOD;
	return is_blank || is_token_character(c);
}

bool request_line_take(struct request_line *line, const char *data, size_t size)
{
	for (size_t i = 0; i < size && line->state != REQUEST_LINE_READ; i++)
		if (!take(line, data[i]))
			return false;
	return true;
}
