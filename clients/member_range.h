/* "member=FROM..TO": a member of a scene and two numbers. */
#ifndef STRATUS_CLIENTS_MEMBER_RANGE_H
#define STRATUS_CLIENTS_MEMBER_RANGE_H

#include <jansson.h>
#include <stdbool.h>

struct member_range {
	char member[128]; /* dotted */
	double from, to;
	bool whole; /* both were written as whole numbers */
};

/* false when the text is none; nothing is said then. */
bool member_range_read(const char *text, struct member_range *range);

/* from + share (to - from), as nine digits tell it exactly, so that what is written down is what was asked for. NULL: out of memory. */
json_t *member_range_at(const struct member_range *range, double share);

#endif
