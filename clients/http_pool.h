/* Renders by the number: so many requests at once, each asked again while the daemon is busy. One thread. */
#ifndef STRATUS_CLIENTS_HTTP_POOL_H
#define STRATUS_CLIENTS_HTTP_POOL_H

#include "clients/http.h"

enum { POOL_AT_ONCE_MAX = 256 };

enum pool_next {
	POOL_JOB,
	POOL_LATER, /* none before an answer was taken */
	POOL_END,
};

struct pool_job {
	int index;  /* the caller's */
	char *body; /* JSON of POST /v1/render, malloc'd by next, freed by the pool */
};

struct pool_work {
	void *context;
	enum pool_next (*next)(void *context, struct pool_job *job);
	/* An answer that is not to be waited out, whatever its status. CLIENT_OK: go on; else the pool ends with it. */
	int (*take)(void *context, const struct pool_job *job, struct http_response *response);
	/* Ten times a second. busy: asked again for the time being; retries: since the start. */
	void (*tick)(void *context, int busy, int retries);
};

struct pool_settings {
	int at_once; /* 1 to POOL_AT_ONCE_MAX */
	int retries; /* of one request */
};

/* Until next says POOL_END and all is answered. A 429, a 503 and a connection that fails are tried again: after what Retry-After asks for,
 * and not before 0.25 s, doubled each time up to 30 s. Such a request keeps its place, so that fewer are under way at a daemon that has
 * enough. An enum client_exit: that of take; CLIENT_UNREACHABLE after a message when one request found no connection any more;
 * CLIENT_INTERRUPTED. */
int http_pool_run(const struct client *client, const struct pool_settings *settings, const struct pool_work *work);

/* Rows for the table of a command whose options hold a struct pool_settings. */
/* clang-format off */
#define POOL_ROWS(type, member)                                                                                                          \
	WHOLE_ROW("at-once", "N", 1, POOL_AT_ONCE_MAX, type, member.at_once, "requests under way at a time (4)"),                        \
	WHOLE_ROW("retries", "N", 0, 1000, type, member.retries,                                                                         \
		  "how often one is asked again while the daemon is busy (429, 503) or away, later each time (10)")
/* clang-format on */
#define POOL_DEFAULTS                                                                                                                      \
	{                                                                                                                                  \
		.at_once = 4, .retries = 10                                                                                                \
	}

#endif
