#include "clients/client.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

void client_error(const char *format, ...)
{
	va_list args;
	va_start(args, format);
	fputs("stratus: ", stderr);
	vfprintf(stderr, format, args);
	fputc('\n', stderr);
	va_end(args);
}

void client_help(const struct command *command)
{
	printf("usage: stratus %s [options]%s%s\n\n%s.\n\n%s", command->name, *command->arguments ? " " : "", command->arguments,
	       command->summary, command->help);
	fputs("  --server URL       of the daemon (STRATUS_SERVER, else http://127.0.0.1:8080)\n"
	      "  --key KEY          to show to the daemon (better in STRATUS_API_KEY: others on this machine may see options)\n"
	      "  --ca-cert FILE     authorities that may vouch for the daemon of an https address (STRATUS_CA_CERT, else the system's)\n"
	      "  --timeout SECONDS  give up, here and in the daemon, after so long\n"
	      "  -q, --quiet        errors alone on standard error\n"
	      "  -h, --help         this text\n",
	      stdout);
}

static int set_timeout(struct client *client, const char *text)
{
	char *end;
	const double seconds = strtod(text, &end);
	if (end == text || *end || !(seconds >= 0.001 && seconds <= 3600)) { /* the daemon takes no more */
		client_error("--timeout wants seconds, 0.001 to 3600, not \"%s\"", text);
		return CLIENT_USAGE;
	}
	client->timeout_s = seconds;
	return -1;
}

int client_option(struct client *client, int option)
{
	switch (option) {
	case 'S':
		client->server = optarg;
		return -1;
	case 'K':
		client->key = optarg;
		return -1;
	case 'C':
		client->ca_cert = optarg;
		return -1;
	case 'T':
		return set_timeout(client, optarg);
	case 'q':
		client->quiet = true;
		return -1;
	case 'h':
		client_help(client->command);
		return CLIENT_OK;
	default:
		fprintf(stderr, "stratus %s --help lists the options\n", client->command->name);
		return CLIENT_USAGE;
	}
}
