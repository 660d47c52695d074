/* Growing text. Running out of memory is remembered rather than reported at every call: later calls do nothing and text_take
 * returns NULL. No locking: one thread at a time.
 */
#ifndef STRATUS_SERVER_TEXT_H
#define STRATUS_SERVER_TEXT_H

#include <stdbool.h>
#include <stddef.h>

/* Zero is the empty text. */
struct text {
	char *data; /* NUL-terminated once anything was added */
	size_t length, capacity;
	bool failed; /* out of memory: the content is incomplete */
};

void text_finish(struct text *text);

void text_append(struct text *text, const char *bytes, size_t length);
void text_add(struct text *text, const char *string);
__attribute__((format(printf, 2, 3))) void text_printf(struct text *text, const char *format, ...);

/* Hands the content over to the caller (free) and leaves the empty text; NULL when memory ran out. Never NULL for an empty text. */
char *text_take(struct text *text);

#endif
