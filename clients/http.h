/* One request to the daemon and its whole answer in memory, over libcurl. */
#ifndef STRATUS_CLIENTS_HTTP_H
#define STRATUS_CLIENTS_HTTP_H

#include "clients/client.h"

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct http_request {
	const char *path;   /* from the root, "/v1/render" */
	const char *json;   /* body of a POST; NULL: GET, or */
	FILE *upload;       /* body of a PUT, read to its end; NULL: none */
	int64_t size;       /* of the upload; negative: not known before */
	bool remove;        /* DELETE */
	const char *header; /* one more, whole, or NULL */
	const char *accept; /* header, whole; NULL: anything */
	bool shows_time;    /* by http_send: on a terminal, once it takes longer than a second, how long it has taken */
};

struct http_response {
	long status;
	char *content_type;  /* "" when there is none */
	char *server_timing; /* all Server-Timing headers, joined by commas */
	char *request_id;
	char *body; /* size bytes, then a NUL */
	size_t size;
	double seconds;       /* from the start of the connection to the last byte */
	double retry_after_s; /* that a busy server asks for; 0: it does not */
};

/* CLIENT_OK with any status the server chose, or CLIENT_UNREACHABLE after a message. http_response_finish in either case. */
int http_send(const struct client *client, const struct http_request *request, struct http_response *response);

/* Takes a zeroed response. */
void http_response_finish(struct http_response *response);

/* The same in pieces, for several at once: a request that is prepared, to be driven by its CURL handle, and its answer. */
struct http_exchange;

/* The request's texts are needed until http_exchange_destroy. NULL after a message when out of memory. */
struct http_exchange *http_exchange_create(const struct client *client, const struct http_request *request);
void *http_exchange_handle(struct http_exchange *exchange);
/* The answer of an exchange that has ended; false: out of memory. http_response_finish in either case. */
bool http_exchange_answer(struct http_exchange *exchange, struct http_response *response);
/* Why there is none, for a CURLcode. */
const char *http_exchange_error(const struct http_exchange *exchange, int code);
/* Takes NULL. */
void http_exchange_destroy(struct http_exchange *exchange);

#endif
