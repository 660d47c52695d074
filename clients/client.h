/* What the subcommands of the client share. The client is one process, one thread. */
#ifndef STRATUS_CLIENTS_CLIENT_H
#define STRATUS_CLIENTS_CLIENT_H

#include <getopt.h>
#include <stdbool.h>

#define CLIENT_VERSION "0.4.0"

enum client_exit {
	CLIENT_OK = 0,
	CLIENT_REFUSED = 1,     /* the server answered, and not with what was asked for */
	CLIENT_USAGE = 2,       /* bad command line or unreadable input */
	CLIENT_UNREACHABLE = 3, /* no connection, or it broke */
	CLIENT_UNWRITABLE = 4,  /* the result could not be written */
};

struct client {
	const struct command *command; /* the one that runs */
	const char *server;            /* URL without a path */
	const char *key;               /* API key; NULL: none */
	const char *ca_cert;           /* file of authorities to trust instead of the system's; NULL: those */
	double timeout_s;              /* 0: none given */
	bool quiet;
};

/* A subcommand: a line in the table of stratus.c and a file of its own. run gets argv[0] = name and returns an enum client_exit. */
struct command {
	const char *name, *arguments, *summary;
	const char *help; /* its own options and remarks, whole lines */
	int (*run)(struct client *client, int argc, char **argv);
};

/* The options every subcommand takes, for its getopt_long; a case of its switch hands them to client_option. */
/* clang-format off */
#define CLIENT_SHORT_OPTIONS "qh"
#define CLIENT_LONG_OPTIONS                                                                                             \
	{"server", required_argument, NULL, 'S'}, {"timeout", required_argument, NULL, 'T'},                            \
	{"key", required_argument, NULL, 'K'}, {"ca-cert", required_argument, NULL, 'C'},                               \
	{"quiet", no_argument, NULL, 'q'}, {"help", no_argument, NULL, 'h'}
/* clang-format on */

/* Takes one option that getopt_long returned. Negative: go on; else the exit status to end with. */
int client_option(struct client *client, int option);

/* Help of one subcommand, on standard output. */
void client_help(const struct command *command);

/* "stratus: ..." on standard error. */
__attribute__((format(printf, 1, 2))) void client_error(const char *format, ...);

#endif
