/* Lists of numbers in a query, "0,15,30". Any thread. */
#ifndef STRATUS_SERVER_QUERY_LIST_H
#define STRATUS_SERVER_QUERY_LIST_H

#include "server/problem.h"

#include <stdbool.h>

struct query_list {
	const char *name;
	double low, high; /* inclusive */
	int most;         /* numbers, from 1 */
};

/* Reads a number within a range. pointer names it in the problem. */
void query_number_read(const char *value, double low, double high, const char *pointer, double *number, struct problem *problem);

/* Reads 1 to list->most numbers into `numbers`, which has room for as many. Everything wrong goes into the problem, by its place. */
void query_list_read(const struct query_list *list, const char *value, double *numbers, int *count, struct problem *problem);

#endif
