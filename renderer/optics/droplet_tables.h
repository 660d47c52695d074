/* All that is computed from a droplet size distribution alone, ready for the renderer: optics, solved slab, tables of the forward peak and
 * of the phase functions. One piece of plain data, so that it can be kept in a file and read back in milliseconds.
 */
#ifndef STRATUS_RENDERER_OPTICS_DROPLET_TABLES_H
#define STRATUS_RENDERER_OPTICS_DROPLET_TABLES_H

#include "renderer/optics/forward.h"
#include "renderer/optics/slab.h"

#include <stddef.h>

enum { DROPLET_PHASE_COLUMNS = 2048 };

/* Read-only once made; may be shared between threads. */
struct droplet_tables {
	const struct optics *optics;
	const struct slab_solution *slab;
	const struct forward_tables *forward;
	/* log2 of P [0] and P_2 [1] at droplet_phase_angle(column): linear interpolation of logarithms is far closer on the flanks of the
	 * forward peak. */
	const float (*phase)[DROPLET_PHASE_COLUMNS][BAND_COUNT];
	size_t bytes; /* of everything */
};

/* Computes the tables on `threads` threads (1..16, and one of its own): 85 to 115 ms on two with AVX-512. Last bits depend on the
 * processor's vectors, not on the number of threads. NULL (and a log line) when out of memory or when something does not come out finite.
 * Any thread. */
struct droplet_tables *droplet_tables_create(const struct kernel *kernel, const struct scene_dsd *dsd, enum optics_model model,
					     int threads);
void droplet_tables_destroy(struct droplet_tables *tables);

/* Angle of a column of `columns`, radians: uniform in sin(angle/2) in front, in cos(angle/2) behind (shaders/lib/optics.glsl). */
double droplet_phase_angle(int column, int columns);

#endif
