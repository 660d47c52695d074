/* Whether bytes can begin a request at all (RFC 9112, 3): a method, which is a token, a blank, and to the line's end nothing that controls.
 * Empty lines before it are none (2.2). What else the line must have is libmicrohttpd's to find. */
#ifndef STRATUS_SERVER_REQUEST_LINE_H
#define STRATUS_SERVER_REQUEST_LINE_H

#include <stdbool.h>
#include <stddef.h>

/* Zero: nothing has come. */
struct request_line {
	enum { REQUEST_LINE_AWAITED, REQUEST_LINE_IN_METHOD, REQUEST_LINE_IN_TARGET, REQUEST_LINE_READ } state;
	size_t empty_bytes; /* of the lines before it */
};

/* Takes what follows the bytes before. false: no request begins like this. */
bool request_line_take(struct request_line *line, const char *data, size_t size);

#endif
