/* What a load measured, for people and for programs. */
#ifndef STRATUS_CLIENTS_BENCH_REPORT_H
#define STRATUS_CLIENTS_BENCH_REPORT_H

#include "clients/bench/load.h"

#include <jansson.h>
#include <stdio.h>

/* All in milliseconds, as tables. */
void report_print(FILE *to, const struct load_settings *settings, const struct mix *mix, const struct load_result *result);

/* The same as an object of seconds and requests/s (docs/bench.md); NULL when out of memory. */
json_t *report_json(const struct load_settings *settings, const struct mix *mix, const struct load_result *result);

#endif
