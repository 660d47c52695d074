/* A load on a daemon, and what it measured.
 *
 * Open: requests are due at times of a plan that knows nothing of the answers, and a latency counts from the time its request was due, not
 * from when it could be sent, so that a daemon that stands still is charged with everyone who would have come meanwhile (coordinated
 * omission does not occur). Closed: a number of clients that each ask again as soon as they are answered.
 *
 * One thread, one epoll; no allocation for requests that are always the same.
 */
#ifndef STRATUS_CLIENTS_BENCH_LOAD_H
#define STRATUS_CLIENTS_BENCH_LOAD_H

#include "clients/bench/histogram.h"
#include "clients/bench/mix.h"

enum { LOAD_STATUS_MAX = 600, LOAD_STAGES_MAX = 24, LOAD_STAGE_NAME_SIZE = 32 };

enum load_error {
	LOAD_NO_CONNECTION,
	LOAD_BROKEN,    /* the connection was closed or reset */
	LOAD_NO_HTTP,   /* what came is none */
	LOAD_TIMED_OUT, /* no answer in time */
	LOAD_ERROR_COUNT
};

extern const char *const load_error_names[LOAD_ERROR_COUNT];

struct load_settings {
	double rate;          /* requests/s of an open load; 0: closed */
	bool random_arrivals; /* exponential gaps (a Poisson process); else even ones */
	int connections;      /* of a closed load as many as ask; of an open one the most there may be */
	double warm_up_s;     /* asked before, and not measured */
	double duration_s;
	double timeout_s; /* a request without an answer so long after it was due is given up */
	double seed;      /* a whole number */
};

/* A stage of the daemon, as its Server-Timing names it. */
struct load_stage {
	char name[LOAD_STAGE_NAME_SIZE];
	struct histogram *latency;
};

struct load_result {
	double seconds;                        /* measured, from the first plan to the last */
	uint64_t planned;                      /* within them */
	uint64_t status[LOAD_STATUS_MAX];      /* answers to those, by status */
	uint64_t error[LOAD_ERROR_COUNT];      /* and those without one */
	uint64_t bytes;                        /* of answers' bodies */
	struct histogram *good;                /* latency of answers 2xx and 304 */
	struct histogram *refused;             /* of 429 and 503 */
	struct histogram *other;               /* of all the rest */
	struct histogram *kind[MIX_KINDS_MAX]; /* of good ones, by kind of request */
	struct load_stage stage[LOAD_STAGES_MAX];
	int stages;
	int connections;         /* most that were open at once */
	uint64_t late;           /* requests that had to wait for a connection: --connections was too small */
	double processor_s;      /* that the load generator took itself, warm-up included */
	uint64_t unanswered;     /* of an interrupted load: due or asked then, without an answer yet, and not in `planned` */
	double good_seconds_end; /* when the last good answer came, from the start of the measured time */
};

/* From now on SIGINT and SIGTERM end a load at once, with what was measured until then; a second one ends the process. */
void load_catch_interrupts(void);

/* Runs a load; `mix` is not prepared yet. An enum client_exit, after a message when not CLIENT_OK; CLIENT_INTERRUPTED: the result is that
 * of the time until then. load_result_finish in any case. */
int load_run(const struct client *client, struct mix *mix, const struct load_settings *settings, struct load_result *result);

/* Takes a zeroed result. */
void load_result_finish(struct load_result *result);

#endif
