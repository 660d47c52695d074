/* How far work by the number has come: a bar with rate and time left where standard error is a terminal, else nothing before its end. */
#ifndef STRATUS_CLIENTS_PROGRESS_H
#define STRATUS_CLIENTS_PROGRESS_H

#include "clients/client.h"

struct progress {
	const char *what; /* "pictures" */
	int total, kept;  /* kept: were there before */
	int made, failed; /* since progress_begin */
	bool shown;       /* on a terminal */
	double start_s;
};

/* The caller fills what, total and kept before. */
void progress_begin(struct progress *progress, const struct client *client);
/* busy: requests that are put off; retries: since the start. */
void progress_draw(const struct progress *progress, int busy, int retries);
/* Takes the bar away, so that other lines can be written. */
void progress_clear(const struct progress *progress);
/* A line of what came of it, unless the client is quiet. */
void progress_end(const struct progress *progress, const struct client *client, int retries);

#endif
