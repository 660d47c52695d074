/* The query of /v1/sky: sun, atmosphere and ground of a scene, and where to look. Any thread. */
#ifndef STRATUS_SERVER_SKY_QUERY_H
#define STRATUS_SERVER_SKY_QUERY_H

#include "server/scene_query.h"

/* As many directions as make a hemisphere in steps of one degree. */
enum { SKY_VIEWS_MAX = 91, SKY_AZIMUTHS_MAX = 361 };

struct sky_query {
	struct scene_input input;      /* sun, atmosphere and ground; without clouds */
	int view_count, azimuth_count; /* from 1 */
	double view_zenith_deg[SKY_VIEWS_MAX];
	double azimuth_deg[SKY_AZIMUTHS_MAX]; /* of the viewing direction, clockwise from north */
};

/* Reads the text behind the question mark (NULL: none). Everything wrong goes into the problem; without one the query can be computed. */
void sky_query_read(const char *text, struct sky_query *query, struct problem *problem);

/* All that decides about the answer, as one line; the caller frees. NULL when out of memory. */
char *sky_query_canonical(const struct sky_query *query);

#endif
