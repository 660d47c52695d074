/* The query of a request target, as names and values. Any thread.
 *
 * Percent-escapes are decoded; a plus stays a plus (no value of ours holds a space, but times hold plusses).
 */
#ifndef STRATUS_SERVER_QUERY_H
#define STRATUS_SERVER_QUERY_H

#include "server/problem.h"

#include <stddef.h>

enum { QUERY_PAIRS_MAX = 128 };

struct query_pair {
	const char *name, *value; /* UTF-8, in the query's buffer */
};

struct query {
	char *buffer;
	size_t count;
	struct query_pair pairs[QUERY_PAIRS_MAX];
};

/* Splits the text behind the question mark (NULL: none). false and PROBLEM_BAD_REQUEST for escapes that are none, escaped NULs, text that
 * is not UTF-8, too many members. query_finish in any case. */
bool query_parse(const char *text, struct query *query, struct problem *problem);
void query_finish(struct query *query);

/* Decodes percent-escapes in place. false for what is no escape, and for NUL. */
bool query_decode(char *text);

#endif
