#include "clients/client.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

const struct option_row client_options[] = {
	TEXT_ROW("server", 0, "URL", WORDS_ANY, struct client, server, "of the daemon (STRATUS_SERVER, else http://127.0.0.1:8080)"),
	TEXT_ROW("key", 0, "KEY", WORDS_ANY, struct client, key,
		 "to show to the daemon (better in STRATUS_API_KEY: others on this machine may see options)"),
	TEXT_ROW("ca-cert", 0, "FILE", WORDS_FILE, struct client, ca_cert,
		 "authorities that may vouch for the daemon of an https address (STRATUS_CA_CERT, else the system's)"),
	NUMBER_ROW("timeout", "SECONDS", 0.001, 3600, struct client, timeout_s, "give up, here and in the daemon, after so long"),
	FLAG_ROW("quiet", 'q', struct client, quiet, "errors alone on standard error"),
	FLAG_ROW("help", 'h', struct client, help, "this text"),
	{0}};

void client_error(const char *format, ...)
{
	va_list args;
	va_start(args, format);
	fputs("stratus: ", stderr);
	vfprintf(stderr, format, args);
	fputc('\n', stderr);
	va_end(args);
}

int client_end_output(void)
{
	errno = 0;
	if (fflush(stdout) == 0 && !ferror(stdout))
		return CLIENT_OK;
	client_error("standard output: %s", errno ? strerror(errno) : "not all of it could be written");
	return CLIENT_UNWRITABLE;
}
