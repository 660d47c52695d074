/* What the commands of the client share. One process, one thread. */
#ifndef STRATUS_CLIENTS_CLIENT_H
#define STRATUS_CLIENTS_CLIENT_H

#include "clients/options.h"

#define CLIENT_VERSION "0.4.0"

enum client_exit {
	CLIENT_OK = 0,
	CLIENT_REFUSED = 1,       /* the server answered, and not with what was asked for */
	CLIENT_USAGE = 2,         /* bad command line or unreadable input */
	CLIENT_UNREACHABLE = 3,   /* no connection, or it broke */
	CLIENT_UNWRITABLE = 4,    /* the result could not be written */
	CLIENT_INTERRUPTED = 130, /* by SIGINT or SIGTERM, where work that is kept was going on */
};

struct client {
	const char *server;  /* URL without a path */
	const char *key;     /* API key; NULL: none */
	const char *ca_cert; /* file of authorities to trust instead of the system's; NULL: those */
	double timeout_s;    /* 0: none given */
	bool quiet, help;
};

/* The options that every command takes; their offsets count in a struct client. */
extern const struct option_row client_options[];

/* "stratus: ..." on standard error. */
__attribute__((format(printf, 1, 2))) void client_error(const char *format, ...);

/* Everything printed on standard output is there: an enum client_exit, after a message when it is not CLIENT_OK. */
int client_end_output(void);

#endif
