/* Tables of droplet size distributions, computed once: kept in memory (bounded bytes, least recently used out first) and on disk.
 *
 * Any thread may ask. Who asks for what another is computing waits for that one; other distributions go on. A file that is damaged, or
 * was written by another version, kernel table or instruction set, is reported, recomputed and replaced, never trusted. A disk that
 * cannot be written costs a warning and nothing else; nobody waits for it.
 */
#ifndef STRATUS_RENDERER_DROPLET_STORE_H
#define STRATUS_RENDERER_DROPLET_STORE_H

#include "renderer/optics/droplet_tables.h"
#include "renderer/optics/paper_fit.h"

#include <stdint.h>

struct droplet_store;

struct droplet_store_params {
	const struct kernel *kernel; /* must outlive the store */
	const char *directory;       /* made when first needed; NULL: memory alone. Copied. */
	size_t memory_bytes;         /* bound of what is kept; what is held may exceed it, and as much as waits for the disk. 0: 256 MiB */
	uint64_t disk_bytes;         /* bound of the files, oldest use out first; 0: 1 GiB */
	int threads;                 /* of one computation; 0: as many as processors, at most 4 */
};

/* What another asker computed meanwhile, or read, comes from memory. */
enum droplet_source { DROPLETS_FROM_MEMORY, DROPLETS_FROM_DISK, DROPLETS_COMPUTED, DROPLET_SOURCE_COUNT };

/* NULL (and a log line) when out of memory or threads. */
struct droplet_store *droplet_store_create(const struct droplet_store_params *params);
/* All tables must have been released. Finishes writing first. Takes NULL. */
void droplet_store_destroy(struct droplet_store *store);

/* The tables of a distribution, from wherever they are soonest had: 1 us from memory, 3 ms from disk, 85 ms and more when computed. Held
 * until droplet_store_release. NULL (and a log line) when they cannot be computed. source may be NULL. */
const struct droplet_tables *droplet_store_get(struct droplet_store *store, const struct scene_dsd *dsd, enum optics_model model,
					       enum droplet_source *source);
/* Takes NULL. */
void droplet_store_release(struct droplet_store *store, const struct droplet_tables *tables);

/* The tables when they are in memory now, held likewise; else NULL. Never waits. NULL also for tables that nobody holds yet while so much
 * is held by others that the bound would be exceeded: who holds tables for long asks so, and waits for room before droplet_store_get. */
const struct droplet_tables *droplet_store_find(struct droplet_store *store, const struct scene_dsd *dsd, enum optics_model model);

/* Waits, for at most so long, until the bound has room for one more distribution's tables beside those held. */
bool droplet_store_await_room(struct droplet_store *store, int milliseconds);

/* The paper's fit, from wherever it is soonest had, copied out. false (and a log line) when it cannot be computed. */
bool droplet_store_get_fit(struct droplet_store *store, const struct scene_dsd *dsd, enum optics_model model, struct paper_fit_table *fit,
			   enum droplet_source *source);

/* Are the tables (fit: and the paper's fit) in memory now? Never waits for a computation. */
bool droplet_store_has(struct droplet_store *store, const struct scene_dsd *dsd, enum optics_model model, bool fit);

/* For metrics. */
struct droplet_store_counts {
	uint64_t from[DROPLET_SOURCE_COUNT]; /* answers by source, fits included */
	uint64_t damaged_files;              /* damaged or foreign ones, recomputed */
	uint64_t memory_bytes;               /* kept now */
};
struct droplet_store_counts droplet_store_counts(struct droplet_store *store);

#endif
