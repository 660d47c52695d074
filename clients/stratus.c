/* The command line client: finds the subcommand and hands over. */
#include "clients/commands.h"

#include <curl/curl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct command *const commands[] = {&command_render, &command_compare, &command_asset,  &command_presets,
						 &command_info,   &command_bench,   &command_health, NULL};

static void print_usage(FILE *to)
{
	fputs("usage: stratus [--server URL] [--key KEY] [--ca-cert FILE] COMMAND [options]\n\n", to);
	for (int i = 0; commands[i]; i++)
		fprintf(to, "  %-10s %s\n", commands[i]->name, commands[i]->summary);
	fputs("\n  stratus COMMAND --help, stratus --version\n\n"
	      "The daemon is at --server, else at STRATUS_SERVER, else at http://127.0.0.1:8080. Where it asks for a key: "
	      "STRATUS_API_KEY.\n"
	      "Exit status: 0 done, 1 refused by the server, 2 bad usage or input, 3 cannot connect, 4 cannot write.\n",
	      to);
}

static const struct command *find_command(const char *name)
{
	for (int i = 0; commands[i]; i++)
		if (strcmp(commands[i]->name, name) == 0)
			return commands[i];
	return NULL;
}

/* Options in front of the subcommand. Negative: go on; else the exit status. */
static int read_leading_options(struct client *client, int argc, char **argv)
{
	static const struct option options[] = {{"server", required_argument, NULL, 'S'},  {"key", required_argument, NULL, 'K'},
						{"ca-cert", required_argument, NULL, 'C'}, {"help", no_argument, NULL, 'h'},
						{"version", no_argument, NULL, 'V'},       {0}};
	for (int option; (option = getopt_long(argc, argv, "+hV", options, NULL)) != -1;)
		switch (option) {
		case 'S':
			client->server = optarg;
			break;
		case 'K':
			client->key = optarg;
			break;
		case 'C':
			client->ca_cert = optarg;
			break;
		case 'h':
			print_usage(stdout);
			return CLIENT_OK;
		case 'V':
			puts("stratus " CLIENT_VERSION);
			return CLIENT_OK;
		default:
			print_usage(stderr);
			return CLIENT_USAGE;
		}
	return -1;
}

/* NULL when it is empty, too. */
static const char *variable(const char *name)
{
	const char *value = getenv(name);
	return value && *value ? value : NULL;
}

int main(int argc, char **argv)
{
	const char *server = variable("STRATUS_SERVER");
	struct client client = {.server = server ? server : "http://127.0.0.1:8080",
				.key = variable("STRATUS_API_KEY"),
				.ca_cert = variable("STRATUS_CA_CERT")};
	int status = read_leading_options(&client, argc, argv);
	if (status >= 0)
		return status;
	if (optind == argc) {
		print_usage(stderr);
		return CLIENT_USAGE;
	}
	client.command = find_command(argv[optind]);
	if (!client.command) {
		client_error("there is no command \"%s\"", argv[optind]);
		print_usage(stderr);
		return CLIENT_USAGE;
	}

	argc -= optind;
	argv += optind;
	optind = 0; /* getopt starts anew */
	curl_global_init(CURL_GLOBAL_DEFAULT);
	status = client.command->run(&client, argc, argv);
	curl_global_cleanup();
	return status;
}
