#include "server/query.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

void query_finish(struct query *query)
{
	free(query->buffer);
	query->buffer = NULL;
	query->count = 0;
}

static int hex_digit(char c)
{
	if (c >= '0' && c <= '9')
		return c - '0';
	c |= 0x20;
	return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

bool query_decode(char *text)
{
	char *out = text;
	for (const char *in = text; *in; in++) {
		if (*in != '%') {
			*out++ = *in;
			continue;
		}
		int high = hex_digit(in[1]);
		int low = high < 0 ? -1 : hex_digit(in[2]);
		if (low < 0 || high + low == 0)
			return false;
		*out++ = (char)(high << 4 | low);
		in += 2;
	}
	*out = '\0';
	return true;
}

static bool is_utf8(const char *text)
{
	json_t *string = json_string(text);
	json_decref(string);
	return string != NULL;
}

static bool add_pair(char *member, struct query *query)
{
	char *value = strchr(member, '=');
	if (value)
		*value++ = '\0';
	else
		value = member + strlen(member);
	if (!query_decode(member) || !query_decode(value) || !is_utf8(member) || !is_utf8(value))
		return false;
	query->pairs[query->count++] = (struct query_pair){member, value};
	return true;
}

bool query_parse(const char *text, struct query *query, struct problem *problem)
{
	query->count = 0;
	query->buffer = strdup(text ? text : "");
	if (!query->buffer) {
		problem_set(problem, PROBLEM_INTERNAL, "Out of memory.");
		return false;
	}
	char *rest = NULL;
	for (char *member = strtok_r(query->buffer, "&", &rest); member; member = strtok_r(NULL, "&", &rest)) {
		if (query->count == QUERY_PAIRS_MAX) {
			problem_set(problem, PROBLEM_BAD_REQUEST, "The query has more than %d members.", QUERY_PAIRS_MAX);
			return false;
		}
		if (!add_pair(member, query)) {
			problem_set(problem, PROBLEM_BAD_REQUEST, "Member %zu of the query has a bad percent-escape or is not UTF-8.",
				    query->count + 1);
			return false;
		}
	}
	return true;
}
