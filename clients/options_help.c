#include "clients/options.h"

#include <string.h>

enum { WIDTH = 118, COLUMN_MAX = 30 };

/* "-o, --output FILE" */
static int write_name(char *text, size_t size, const struct option_row *row)
{
	char letter[8] = "";
	if (row->letter)
		snprintf(letter, sizeof letter, "-%c, ", row->letter);
	return snprintf(text, size, "%s--%s%s%s", letter, row->name, row->argument ? " " : "", row->argument ? row->argument : "");
}

static int larger(int a, int b)
{
	return a > b ? a : b;
}

static int column_of(const struct option_row *rows)
{
	char name[96];
	int column = 0;
	for (const struct option_row *row = rows; row && row->name; row++) {
		const int length = write_name(name, sizeof name, row);
		if (length <= COLUMN_MAX)
			column = larger(column, length);
	}
	return column;
}

/* Words up to the width, the next lines under the first. */
static void print_folded(FILE *to, const char *text, int column)
{
	int at = column;
	while (*text) {
		const int length = (int)strcspn(text, " ");
		if (at > column && at + 1 + length > WIDTH) {
			fprintf(to, "\n%*s", column, "");
			at = column;
		} else if (at > column) {
			fputc(' ', to);
			at++;
		}
		fprintf(to, "%.*s", length, text);
		at += length;
		text += length;
		text += *text == ' ';
	}
	fputc('\n', to);
}

void options_print(FILE *to, const struct option_row *const *tables, int count)
{
	char name[96];
	int column = 0;
	for (int i = 0; i < count; i++)
		column = larger(column, column_of(tables[i]));
	for (int i = 0; i < count; i++)
		for (const struct option_row *row = tables[i]; row && row->name; row++) {
			write_name(name, sizeof name, row);
			fprintf(to, "  %-*s  ", column, name);
			print_folded(to, row->help, column + 4);
		}
}
