#include "clients/options.h"

#include "clients/client.h"

#include <getopt.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FIRST_VALUE = 256 }; /* what getopt_long returns for the first row: above all letters */

/* The rows of all targets as getopt_long wants them. */
struct getopt_tables {
	struct option option[OPTION_ROWS_MAX + 1];
	const struct option_row *row[OPTION_ROWS_MAX];
	void *target[OPTION_ROWS_MAX];
	char letters[2 * OPTION_ROWS_MAX + 2];
	int count;
};

static void add_row(struct getopt_tables *tables, const struct option_row *row, void *options)
{
	const int index = tables->count++;
	const int wants = row->argument ? required_argument : no_argument;
	size_t end = strlen(tables->letters);
	tables->option[index] = (struct option){row->name, wants, NULL, FIRST_VALUE + index};
	tables->row[index] = row;
	tables->target[index] = options;
	if (row->letter)
		tables->letters[end++] = row->letter;
	if (row->letter && row->argument)
		tables->letters[end++] = ':';
}

static int index_of(const struct getopt_tables *tables, int found)
{
	if (found >= FIRST_VALUE)
		return found - FIRST_VALUE;
	for (int i = 0; i < tables->count; i++)
		if (tables->row[i]->letter == found)
			return i;
	return -1;
}

static bool take_number(const struct option_row *row, const char *value, double *number)
{
	const bool whole = row->kind == OPTION_WHOLE;
	char *end;
	*number = strtod(value, &end);
	if (end != value && !*end && *number >= row->low && *number <= row->high && (!whole || *number == floor(*number)))
		return true;
	client_error("--%s wants a %snumber from %.10g to %.10g, not \"%s\"", row->name, whole ? "whole " : "", row->low, row->high, value);
	return false;
}

static bool is_choice(const struct option_row *row, const char *value)
{
	const size_t length = strlen(value);
	for (const char *at = row->choices; at && *at; at += strcspn(at, " "), at += *at == ' ')
		if (length > 0 && strcspn(at, " ") == length && strncmp(at, value, length) == 0)
			return true;
	if (!row->choices)
		return true;
	client_error("--%s is one of %s, not \"%s\"", row->name, row->choices, value);
	return false;
}

static bool append(struct text_list *list, const char *value)
{
	const char **longer = realloc(list->text, ((size_t)list->count + 1) * sizeof *longer);
	if (!longer) {
		client_error("out of memory");
		return false;
	}
	list->text = longer;
	list->text[list->count++] = value;
	return true;
}

static bool take(const struct option_row *row, void *options, const char *value)
{
	void *place = (char *)options + row->offset;
	double number;
	switch (row->kind) {
	case OPTION_FLAG:
		*(bool *)place = true;
		return true;
	case OPTION_TEXT:
		*(const char **)place = value;
		return is_choice(row, value);
	case OPTION_LIST:
		return append(place, value);
	case OPTION_NUMBER:
		return take_number(row, value, place);
	case OPTION_WHOLE:
		if (!take_number(row, value, &number))
			return false;
		*(int *)place = (int)number;
		return true;
	default:
		return row->take(options, value);
	}
}

int options_read(const struct option_target *targets, int count, bool anywhere, int argc, char **argv)
{
	struct getopt_tables tables = {.letters = ""};
	if (!anywhere)
		strcpy(tables.letters, "+");
	for (int i = 0; i < count; i++)
		for (const struct option_row *row = targets[i].rows; row && row->name; row++)
			add_row(&tables, row, targets[i].options);
	optind = 0; /* getopt starts anew */
	for (int found; (found = getopt_long(argc, argv, tables.letters, tables.option, NULL)) != -1;) {
		const int index = index_of(&tables, found);
		if (index < 0 || !take(tables.row[index], tables.target[index], optarg))
			return -1;
	}
	return optind;
}

void options_finish(const struct option_target *target)
{
	for (const struct option_row *row = target->rows; row && row->name; row++)
		if (row->kind == OPTION_LIST)
			free(((struct text_list *)((char *)target->options + row->offset))->text);
}
