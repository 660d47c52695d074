/* Memory of droplet tables, in one piece. Private to the optics and their files. */
#ifndef STRATUS_RENDERER_OPTICS_DROPLET_STORAGE_H
#define STRATUS_RENDERER_OPTICS_DROPLET_STORAGE_H

#include "renderer/optics/droplet_tables.h"
#include "renderer/optics/optics_storage.h"

#include <sys/uio.h>

struct droplet_storage {
	struct droplet_tables tables; /* whose pointers lead into what follows */
	struct optics_storage optics;
	struct slab_solution slab;
	struct forward_tables forward;
	float phase[2][DROPLET_PHASE_COLUMNS][BAND_COUNT];
};

/* Memory with all pointers set and else unset. NULL when there is none. Ended by droplet_tables_destroy(&storage->tables). */
struct droplet_storage *droplet_storage_create(void);

/* Where the data lie, without pointers, for a file. */
enum { DROPLET_STORAGE_PARTS = 2 };
void droplet_storage_parts(struct droplet_storage *storage, struct iovec parts[DROPLET_STORAGE_PARTS]);

#endif
