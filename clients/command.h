/* A subcommand: a row in the list of commands.c and a file of its own. */
#ifndef STRATUS_CLIENTS_COMMAND_H
#define STRATUS_CLIENTS_COMMAND_H

#include "clients/client.h"

struct command {
	const char *name, *arguments, *summary;
	const char *remarks;              /* help above the options, whole lines; NULL: none */
	const char *notes;                /* and below them */
	const struct option_row *options; /* its own; NULL: none */
	size_t size;                      /* of the struct that they set, which starts as *defaults, or zeroed when that is NULL */
	const void *defaults;
	int words_min, words_max;
	enum option_words words; /* what the words are, for a shell */
	const char *choices;     /* the first of them, likewise, with a space between; NULL: any */
	/* words: NULL behind the last. An enum client_exit. */
	int (*run)(struct client *client, void *options, char **words);
	void (*finish)(void *options); /* what OPTION_TAKE rows have made; NULL: nothing */
};

/* All of them, in the order of the help; NULL behind the last. */
extern const struct command *const commands[];

/* NULL when there is none. */
const struct command *command_find(const char *name);

/* Reads the command line from the command's name on, and runs it. An enum client_exit. */
int command_start(const struct command *command, struct client *client, int argc, char **argv);

#endif
