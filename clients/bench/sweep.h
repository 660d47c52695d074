/* Loads at rising rates until the daemon does not bear them any more: where its knee is. One thread. */
#ifndef STRATUS_CLIENTS_BENCH_SWEEP_H
#define STRATUS_CLIENTS_BENCH_SWEEP_H

#include "clients/bench/load.h"

#include <jansson.h>

enum { SWEEP_STEPS_MAX = 40 };

struct sweep_settings {
	struct load_settings load; /* rate: of the first step; 0: a quarter of what a closed load of four gets */
	double p99_ms;             /* a rate that is borne has no longer a 99th percentile; 0: any */
};

struct sweep_step {
	double rate;
	bool borne;
	json_t *report; /* report_json */
};

struct sweep {
	struct sweep_step step[SWEEP_STEPS_MAX]; /* by rate */
	int steps;
	double usual_ms;     /* the least median of all steps */
	double knee, beyond; /* the highest rate that was borne, the lowest that was not; 0: none */
};

/* Half as much again each time until a rate is not borne, then between the two. A rate is borne when 99 % are answered well, at 95 % of the
 * rate at least (so that nothing piles up), within p99_ms. An enum client_exit, after a message when it is not CLIENT_OK;
 * CLIENT_INTERRUPTED (load_catch_interrupts): the steps are those that were whole. sweep_finish in any case. */
int sweep_run(const struct client *client, struct mix *mix, const struct sweep_settings *settings, struct sweep *sweep);

void sweep_print(FILE *to, const struct sweep *sweep);
/* {"knee_per_s", "beyond_per_s", "steps": [{"rate_per_s", "borne", "report"}]} */
json_t *sweep_json(const struct sweep *sweep);
/* Latencies and good answers over the rate, as a figure. An enum client_exit. */
int sweep_draw(const struct sweep *sweep, const char *path);

void sweep_finish(struct sweep *sweep);

#endif
