/* The figures of a comparison for people. */
#ifndef STRATUS_CLIENTS_COMPARE_TABLE_H
#define STRATUS_CLIENTS_COMPARE_TABLE_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* comparison: as /v1/compare answers it. false when it is no such thing; then nothing was printed. */
bool compare_table_print(FILE *to, const json_t *comparison);

#endif
