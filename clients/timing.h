/* Where the time of a request went: the Server-Timing header (W3C) as a table. */
#ifndef STRATUS_CLIENTS_TIMING_H
#define STRATUS_CLIENTS_TIMING_H

#include <stddef.h>
#include <stdio.h>

struct timing {
	char name[32];
	char note[48]; /* the description, "" when there is none */
	double milliseconds;
};

struct timing_table {
	struct timing row[32]; /* what a server sends beyond is dropped */
	int count;
};

/* Reads `name;dur=1.5;desc="text", ...`; skips what it does not know, as the specification asks. */
void timing_parse(const char *header, struct timing_table *table);

/* The table, then the client's own view of the request. */
void timing_print(FILE *to, const struct timing_table *table, double client_ms, size_t bytes);

#endif
