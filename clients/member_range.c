#include "clients/member_range.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A JSON number; false when it is none. */
static bool read_number(const char *text, size_t length, double *number, bool *whole)
{
	json_t *value = json_loadb(text, length, JSON_DECODE_ANY, NULL);
	const bool good = json_is_number(value);
	*number = json_number_value(value);
	*whole &= json_is_integer(value);
	json_decref(value);
	return good;
}

bool member_range_read(const char *text, struct member_range *range)
{
	const char *equals = strchr(text, '='), *dots = equals ? strstr(equals, "..") : NULL;
	const size_t length = equals ? (size_t)(equals - text) : 0;
	*range = (struct member_range){.whole = true};
	if (!dots || length == 0 || length >= sizeof range->member)
		return false;
	memcpy(range->member, text, length);
	return read_number(equals + 1, (size_t)(dots - equals - 1), &range->from, &range->whole) &&
	       read_number(dots + 2, strlen(dots + 2), &range->to, &range->whole);
}

json_t *member_range_at(const struct member_range *range, double share)
{
	char text[32];
	snprintf(text, sizeof text, "%.9g", range->from + share * (range->to - range->from));
	return json_real(strtod(text, NULL));
}
