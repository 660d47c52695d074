#include "clients/timing.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const char *skip_space(const char *at)
{
	return at + strspn(at, " \t");
}

/* Copies a token or a quoted string, cut to the room there is; returns what follows it. */
static const char *read_value(const char *at, char *text, size_t size)
{
	size_t length = 0;
	const int quoted = *at == '"';
	for (at += quoted; *at && (quoted ? *at != '"' : !strchr("=;, \t", *at)); at++) {
		if (quoted && *at == '\\' && at[1])
			at++;
		if (length + 1 < size && (unsigned char)*at >= 0x20)
			text[length++] = *at;
	}
	text[length] = '\0';
	return at + (quoted && *at == '"');
}

/* One `;name=value` of an entry. */
static const char *read_parameter(const char *at, struct timing *row)
{
	char name[32], value[48] = "";
	at = skip_space(read_value(skip_space(at), name, sizeof name));
	if (*at == '=')
		at = read_value(skip_space(at + 1), value, sizeof value);
	if (strcasecmp(name, "dur") == 0)
		row->milliseconds = strtod(value, NULL);
	else if (strcasecmp(name, "desc") == 0)
		memcpy(row->note, value, sizeof row->note);
	return skip_space(at);
}

void timing_parse(const char *header, struct timing_table *table)
{
	const int room = sizeof table->row / sizeof *table->row;
	const char *at = header;
	*table = (struct timing_table){0};
	while (*(at = at + strspn(at, " \t,")) && table->count < room) {
		struct timing *row = &table->row[table->count];
		at = skip_space(read_value(at, row->name, sizeof row->name));
		while (*at == ';')
			at = read_parameter(at + 1, row);
		at += strcspn(at, ",");
		table->count += row->name[0] != '\0';
	}
}

void timing_print(FILE *to, const struct timing_table *table, double client_ms, size_t bytes)
{
	fprintf(to, "%-12s %10s\n", "stage", "ms");
	for (int i = 0; i < table->count; i++) {
		const struct timing *row = &table->row[i];
		fprintf(to, "%-12s %10.2f%s%s\n", row->name, row->milliseconds, *row->note ? "  " : "", row->note);
	}
	fprintf(to, "%-12s %10.2f  %zu bytes\n", "client", client_ms, bytes);
}
