/* The query of /v1/slab: a layer, where light comes from and goes to, and how it is computed. Any thread. */
#ifndef STRATUS_SERVER_SLAB_QUERY_H
#define STRATUS_SERVER_SLAB_QUERY_H

#include "renderer/optics/slab.h"
#include "server/scene_query.h"

/* As many directions as make a hemisphere in steps of one degree. */
enum { SLAB_VIEWS_MAX = 91, SLAB_AZIMUTHS_MAX = 361 };

enum slab_method { SLAB_BY_SOLVER, SLAB_BY_PAPER, SLAB_BY_PHOTONS };

/* Names as `shading` and `orders` give them, ended by NULL. */
extern const char *const slab_method_names[];
extern const char *const slab_phase_names[];

struct slab_query {
	struct scene_input input; /* dsd and model.optics */
	double optical_thickness; /* of every band, > 0; 0: by thickness_m */
	double thickness_m;       /* > 0; 0: by optical_thickness */
	double sun_zenith_deg;
	int view_count, azimuth_count; /* from 1 */
	double view_zenith_deg[SLAB_VIEWS_MAX];
	double relative_azimuth_deg[SLAB_AZIMUTHS_MAX];
	int method;           /* enum slab_method */
	int phase;            /* enum slab_phase, of the orders */
	double photons, seed; /* whole numbers, of SLAB_BY_PHOTONS alone */
	unsigned given;       /* bit set of own parameters, valid or not */
};

/* Reads the text behind the question mark (NULL: none). Everything wrong goes into the problem; without one the query can be computed, in
 * bounded time. */
void slab_query_read(const char *text, struct slab_query *query, struct problem *problem);

/* All that decides about the answer, as one line; the caller frees. NULL when out of memory. */
char *slab_query_canonical(const struct slab_query *query);

#endif
