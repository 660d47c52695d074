#include "server/query_list.h"

#include "server/number_text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { POINTER_SIZE = 512 };

void query_number_read(const char *value, double low, double high, const char *pointer, double *number, struct problem *problem)
{
	char low_text[NUMBER_TEXT_SIZE], high_text[NUMBER_TEXT_SIZE];
	double read;
	number_format(low, low_text);
	number_format(high, high_text);
	if (!number_parse(value, &read))
		problem_add(problem, pointer, "must be a number");
	else if (!(read >= low && read <= high))
		problem_add(problem, pointer, "must be from %s to %s", low_text, high_text);
	else
		*number = read;
}

void query_list_read(const struct query_list *list, const char *value, double *numbers, int *count, struct problem *problem)
{
	char pointer[POINTER_SIZE] = "", *copy = strdup(value), *rest = copy;
	int given = 0;
	pointer_append(pointer, sizeof pointer, list->name);
	if (!copy)
		problem_set(problem, PROBLEM_INTERNAL, "Out of memory.");
	if (!*value)
		problem_add(problem, pointer, "must be a list of at least one number");
	for (char *element = *value ? strsep(&rest, ",") : NULL; element; element = strsep(&rest, ",")) {
		if (given == list->most) {
			problem_add(problem, pointer, "must be a list of at most %d numbers", list->most);
			break;
		}
		char place[POINTER_SIZE + 16];
		snprintf(place, sizeof place, "%s/%d", pointer, given);
		query_number_read(element, list->low, list->high, place, &numbers[given++], problem);
	}
	*count = given;
	free(copy);
}
