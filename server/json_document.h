/* JSON text of strangers into a tree, with what the parser alone does not tell: every repeated member and every number too large for a
 * double, each by its JSON pointer. Any thread.
 */
#ifndef STRATUS_SERVER_JSON_DOCUMENT_H
#define STRATUS_SERVER_JSON_DOCUMENT_H

#include "server/problem.h"

#include <jansson.h>

/* Members and elements in all: a scene has a hundred, a comparison a hundred for each variant. Bytes of a text or a member's name as they
 * are written: no text that means anything here is nearly as long. */
enum { JSON_DOCUMENT_VALUES_MAX = 16384, JSON_DOCUMENT_TEXT_MAX = 65536 };

/* Parses text[0..length), which must be followed by a NUL and may be changed. Whole numbers become reals. NULL when it is not JSON (the
 * problem is then PROBLEM_NOT_JSON with line and column), or too much to be looked at (PROBLEM_INVALID). A tree comes back even when errors
 * were added to the problem. */
json_t *json_document_parse(char *text, size_t length, struct problem *problem);

#endif
