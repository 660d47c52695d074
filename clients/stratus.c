/* The command line client: finds the subcommand and hands over. */
#include "clients/command.h"
#include "clients/commands.h"

#include <stdlib.h>

const struct command *const commands[] = {
	&command_render, &command_batch, &command_animate, &command_compare, &command_presets,    &command_sun, &command_optics,
	&command_asset,  &command_info,  &command_bench,   &command_health,  &command_completion, NULL,
};

static void print_usage(FILE *to)
{
	fputs("usage: stratus [--server URL] [--key KEY] [--ca-cert FILE] COMMAND [options]\n\n", to);
	for (int i = 0; commands[i]; i++)
		fprintf(to, "  %-11s %s\n", commands[i]->name, commands[i]->summary);
	fputs("\n  stratus COMMAND --help, stratus --version\n\n"
	      "The daemon is at --server, else at STRATUS_SERVER, else at http://127.0.0.1:8080. Where it asks for a key: "
	      "STRATUS_API_KEY.\n"
	      "Exit status: 0 done, 1 refused by the server, 2 bad usage or input, 3 cannot connect, 4 cannot write, 130 interrupted.\n",
	      to);
}

/* NULL when it is empty, too. */
static const char *variable(const char *name)
{
	const char *value = getenv(name);
	return value && *value ? value : NULL;
}

int main(int argc, char **argv)
{
	struct {
		bool version;
	} own = {false};
	static const struct option_row version[] = {{.name = "version", .letter = 'V', .help = "of this program", .kind = OPTION_FLAG},
						    {0}};
	const char *server = variable("STRATUS_SERVER");
	struct client client = {.server = server ? server : "http://127.0.0.1:8080",
				.key = variable("STRATUS_API_KEY"),
				.ca_cert = variable("STRATUS_CA_CERT")};
	const struct option_target leading[] = {{client_options, &client}, {version, &own}};
	const int first = options_read(leading, 2, false, argc, argv);
	if (first >= 0 && own.version) {
		puts("stratus " CLIENT_VERSION);
		return CLIENT_OK;
	}
	if (first < 0 || client.help || first == argc) {
		print_usage(first >= 0 && client.help ? stdout : stderr);
		return first >= 0 && client.help ? CLIENT_OK : CLIENT_USAGE;
	}
	const struct command *command = command_find(argv[first]);
	if (!command) {
		client_error("there is no command \"%s\"", argv[first]);
		print_usage(stderr);
		return CLIENT_USAGE;
	}
	return command_start(command, &client, argc - first, argv + first);
}
