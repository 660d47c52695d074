/* The answer of /v1/slab as JSON. Any thread. */
#ifndef STRATUS_SERVER_SLAB_ANSWER_H
#define STRATUS_SERVER_SLAB_ANSWER_H

#include "server/slab_numbers.h"

/* JSON text that repeats the question beside its numbers. The caller frees; NULL when out of memory. */
char *slab_answer_format(const struct slab_query *query, const struct slab_numbers *numbers);

#endif
