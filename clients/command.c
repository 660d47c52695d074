#include "clients/command.h"

#include <curl/curl.h>
#include <stdlib.h>
#include <string.h>

const struct command *command_find(const char *name)
{
	for (int i = 0; commands[i]; i++)
		if (strcmp(commands[i]->name, name) == 0)
			return commands[i];
	return NULL;
}

static void print_usage(FILE *to, const struct command *command)
{
	fprintf(to, "usage: stratus %s [options]%s%s\n", command->name, *command->arguments ? " " : "", command->arguments);
}

static void print_help(const struct command *command)
{
	print_usage(stdout, command);
	printf("\n%s.\n\n", command->summary);
	if (command->remarks)
		printf("%s\n", command->remarks);
	options_print(stdout, (const struct option_row *const[]){command->options, client_options}, 2);
	if (command->notes)
		printf("\n%s", command->notes);
}

static int run(const struct command *command, struct client *client, void *options, char **words, int count)
{
	if (client->help) {
		print_help(command);
		return CLIENT_OK;
	}
	if (count < command->words_min || count > command->words_max) {
		print_usage(stderr, command);
		return CLIENT_USAGE;
	}
	curl_global_init(CURL_GLOBAL_DEFAULT);
	const int status = command->run(client, options, words);
	curl_global_cleanup();
	return status;
}

int command_start(const struct command *command, struct client *client, int argc, char **argv)
{
	void *options = calloc(1, command->size + 1);
	const struct option_target targets[] = {{command->options, options}, {client_options, client}};
	int status = CLIENT_USAGE;
	if (!options) {
		client_error("out of memory");
		return status;
	}
	if (command->defaults)
		memcpy(options, command->defaults, command->size);
	const int first = options_read(targets, 2, true, argc, argv);
	if (first >= 0)
		status = run(command, client, options, argv + first, argc - first);
	else
		fprintf(stderr, "stratus %s --help lists the options\n", command->name);
	if (command->finish)
		command->finish(options);
	options_finish(&targets[0]);
	free(options);
	return status;
}
