/* One HTTP request, from its first line to the last byte of its answer.
 *
 * Made when libmicrohttpd has read the request line, freed in its completion callback and nowhere else. While the request is suspended it
 * belongs to whoever works for it, and to the HTTP thread otherwise; the hand-over is request_resume, after which the worker must not touch
 * it.
 */
#ifndef STRATUS_SERVER_REQUEST_H
#define STRATUS_SERVER_REQUEST_H

#include "server/connections.h"
#include "server/digest.h"
#include "server/key_file.h"
#include "server/metrics.h"
#include "server/problem.h"
#include "server/text.h"

#include <jansson.h>
#include <microhttpd.h>

enum { REQUEST_ID_SIZE = 129, REQUEST_TIMEOUT_MS_MAX = 3600000 };

/* In the log and among the counters, as nginx has it: who asked left before the answer was whole. */
enum { STATUS_CLIENT_LEFT = 499 };

struct request;
struct service;

/* Answers (or suspends) a request. MHD_NO closes the connection without an answer. */
typedef enum MHD_Result request_handler(struct request *request);

struct route {
	const char *path;  /* with a slash at its end: everything below */
	const char *allow; /* methods, as the Allow header says them */
	request_handler *handler;
	enum metrics_route metrics;
};

struct request {
	struct service *service;
	struct MHD_Connection *connection; /* NULL until the headers are in */
	struct connection *socket;         /* NULL: not watched */
	const char *client;                /* key of whom it counts for */
	char *path;                        /* as sent, without the query */
	const char *query;                 /* as sent, behind the question mark; NULL: none */
	char method[8];                    /* for the log, cut when longer */
	bool is_post, is_put, is_head;
	bool closes;       /* its connection is not used again */
	bool is_accepted;  /* read to its end: counted in service->in_flight */
	double started_ms; /* its first byte came */
	char id[REQUEST_ID_SIZE];
	const struct route *route;
	request_handler *next; /* what libmicrohttpd's next call runs */
	struct text body;
	struct problem problem;
	struct timings timings;
	char key[KEY_NAME_SIZE]; /* name of the key that it shows; empty: none */
	double admitted_pixels;  /* of the picture that its key may have */
	unsigned retry_after_s;  /* when the key may have more */
	unsigned status;         /* answered; 0: not yet */
	uint64_t bytes;          /* of the answer's body */
	bool is_past;            /* the answer was written past libmicrohttpd */
	uint64_t sent_before;    /* bytes that the connection had carried before that body */
	unsigned cut_status;     /* of an answer whose client left in the middle of it; 0: none did */
	size_t memory_bytes;     /* of an answer of its own (admission.h) */
	double late_ms;          /* of a request that is refused for it: so much later than it may be */
	char scene[DIGEST_SIZE]; /* hash of the canonical scene that is asked for, for the log; empty: none */

	/* What a route keeps with the request. */
	void *work;
	void (*work_destroy)(void *work);
};

/* target: of the request line; socket: its connection, or NULL. NULL when out of memory. */
struct request *request_create(struct service *service, struct connection *socket, const char *target);
void request_destroy(struct request *request);

/* A request header, NULL when not sent. HTTP thread. */
const char *request_header(const struct request *request, const char *name);

/* Takes X-Request-Id over when it is short and plain, else makes one up. HTTP thread. */
void request_identify(struct request *request);

/* When the answer is no longer wanted, on the clock of clock_now_ms: X-Timeout-Ms, or the configured default, after the request began.
 * Without meaning, and a problem, when that is no such number. HTTP thread. */
double request_read_deadline(struct request *request);

/* HTTP thread: no more calls for this request until request_resume; then `next` runs. */
void request_suspend(struct request *request, request_handler *next);
/* Any thread, once. */
void request_resume(struct request *request);

/* Has the client closed its end, or its sending half? Any thread while suspended (the connection stays open as long). */
bool request_is_abandoned(const struct request *request);

#endif
