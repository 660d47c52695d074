/* Options of a command as a table: reading them, their help and what a shell may complete follow from the same rows. One thread. */
#ifndef STRATUS_CLIENTS_OPTIONS_H
#define STRATUS_CLIENTS_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

struct text_list {
	const char **text; /* count of them, borrowed from the command line */
	int count;
};

enum option_kind {
	OPTION_FLAG,   /* bool: becomes true */
	OPTION_TEXT,   /* const char *, borrowed from the command line */
	OPTION_LIST,   /* struct text_list: every use adds one */
	OPTION_NUMBER, /* double, low to high */
	OPTION_WHOLE,  /* int, low to high */
	OPTION_TAKE,   /* whatever row->take makes of it */
};

/* What a value, or a word behind the options, may be: for a shell that completes it. */
enum option_words { WORDS_ANY, WORDS_FILE, WORDS_FOLDER, WORDS_PRESET, WORDS_MEMBER };

struct option_row {
	const char *name;     /* without its dashes; a row without one ends the table */
	char letter;          /* 0: none */
	const char *argument; /* how help calls the value; NULL: there is none */
	const char *help;
	enum option_kind kind;
	enum option_words words;
	size_t offset;                                  /* of what it sets in the command's options */
	double low, high;                               /* of a number, both allowed */
	const char *choices;                            /* of a text: the only ones there are, with a space between; NULL: any */
	bool (*take)(void *options, const char *value); /* of OPTION_TAKE; false after a message */
};

enum { OPTION_ROWS_MAX = 48 };

/* Rows by kind; `type` is the struct of the command's options. Without a letter: 0. */
/* clang-format off */
#define FLAG_ROW(name_, letter_, type, member, help_)                                                                                    \
	{.name = name_, .letter = letter_, .help = help_, .kind = OPTION_FLAG, .offset = offsetof(type, member)}
#define TEXT_ROW(name_, letter_, argument_, words_, type, member, help_)                                                                 \
	{.name = name_, .letter = letter_, .argument = argument_, .help = help_, .kind = OPTION_TEXT, .words = words_,                   \
	 .offset = offsetof(type, member)}
#define CHOICE_ROW(name_, argument_, choices_, type, member, help_)                                                                      \
	{.name = name_, .argument = argument_, .help = help_, .kind = OPTION_TEXT, .choices = choices_, .offset = offsetof(type, member)}
#define LIST_ROW(name_, argument_, words_, type, member, help_)                                                                          \
	{.name = name_, .argument = argument_, .help = help_, .kind = OPTION_LIST, .words = words_, .offset = offsetof(type, member)}
#define NUMBER_ROW(name_, argument_, low_, high_, type, member, help_)                                                                   \
	{.name = name_, .argument = argument_, .help = help_, .kind = OPTION_NUMBER, .low = low_, .high = high_,                         \
	 .offset = offsetof(type, member)}
#define WHOLE_ROW(name_, argument_, low_, high_, type, member, help_)                                                                    \
	{.name = name_, .argument = argument_, .help = help_, .kind = OPTION_WHOLE, .low = low_, .high = high_,                          \
	 .offset = offsetof(type, member)}
#define TAKE_ROW(name_, argument_, words_, take_, help_)                                                                                 \
	{.name = name_, .argument = argument_, .help = help_, .kind = OPTION_TAKE, .words = words_, .take = take_}
/* clang-format on */

/* Tables and what their offsets count in. */
struct option_target {
	const struct option_row *rows;
	void *options;
};

/* Reads options up to the first word, or, when `anywhere`, between the words as well, which are then moved behind them. Returns the index
 * of the first word; negative after a message when an option is wrong. */
int options_read(const struct option_target *targets, int count, bool anywhere, int argc, char **argv);

/* Lists alone hold memory. */
void options_finish(const struct option_target *target);

/* A line or more for each row of the tables (NULL: an empty one), folded at a width that terminals have. */
void options_print(FILE *to, const struct option_row *const *tables, int count);

#endif
