/* stratus health: one probe, for containers that carry no curl. */
#include "clients/commands.h"
#include "clients/http.h"

#include <stdio.h>

enum { READY = 'r', HEALTH_SECONDS = 5 };

static int run_health(struct client *client, int argc, char **argv)
{
	static const struct option options[] = {{"ready", no_argument, NULL, READY}, CLIENT_LONG_OPTIONS, {0}};
	struct http_request request = {.path = "/healthz"};
	for (int option; (option = getopt_long(argc, argv, CLIENT_SHORT_OPTIONS, options, NULL)) != -1;) {
		if (option == READY) {
			request.path = "/readyz";
			continue;
		}
		const int end = client_option(client, option);
		if (end >= 0)
			return end;
	}
	if (client->timeout_s <= 0)
		client->timeout_s = HEALTH_SECONDS;

	struct http_response response;
	int status = http_send(client, &request, &response);
	if (status == CLIENT_OK && response.status != 200)
		status = CLIENT_REFUSED;
	if (response.status && !client->quiet)
		printf("%s %ld\n", request.path, response.status);
	http_response_finish(&response);
	return status;
}

const struct command command_health = {
	.name = "health",
	.arguments = "",
	.summary = "ask whether the daemon is well (exit status 0) or not",
	.help = "  --ready            ask whether it can render, too (/readyz instead of /healthz)\n",
	.run = run_health,
};
