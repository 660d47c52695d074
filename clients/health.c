/* stratus health: one probe, for containers that carry no curl. */
#include "clients/commands.h"
#include "clients/http.h"

#include <stdio.h>

enum { HEALTH_SECONDS = 5 };

struct health_options {
	bool ready;
};

static int run_health(struct client *client, void *given, char **words)
{
	const struct health_options *options = given;
	const struct http_request request = {.path = options->ready ? "/readyz" : "/healthz"};
	struct http_response response;
	(void)words;
	if (client->timeout_s <= 0)
		client->timeout_s = HEALTH_SECONDS;
	int status = http_send(client, &request, &response);
	if (status == CLIENT_OK && response.status != 200)
		status = CLIENT_REFUSED;
	if (response.status && !client->quiet)
		printf("%s %ld\n", request.path, response.status);
	http_response_finish(&response);
	return status;
}

static const struct option_row rows[] = {
	FLAG_ROW("ready", 0, struct health_options, ready, "ask whether it can render, too (/readyz instead of /healthz)"),
	{0},
};

const struct command command_health = {
	.name = "health",
	.arguments = "",
	.summary = "ask whether the daemon is well (exit status 0) or not",
	.options = rows,
	.size = sizeof(struct health_options),
	.run = run_health,
};
