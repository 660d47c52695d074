/* Droplet tables and fits on disk: a directory of files, bounded by bytes, written by a thread of its own.
 *
 * Nobody waits for the disk to write. Reading is left to whoever asks. Private to renderer/droplet_store.c.
 */
#ifndef STRATUS_RENDERER_DROPLET_DISK_H
#define STRATUS_RENDERER_DROPLET_DISK_H

#include "renderer/optics/droplet_file.h"

struct droplet_disk;

struct droplet_disk_params {
	const char *directory; /* made when first written to; copied */
	uint64_t bytes;        /* bound of all files; those whose last use is longest ago go first */
	uint64_t kernel_hash;
	/* Called for each value given to droplet_disk_write, by the thread or by that call: it is not needed any more. */
	void (*written)(void *context, const void *value);
	void *context;
};

/* Removes what a dead process left in the directory, and what exceeds the bound. NULL (and a log line) on failure. */
struct droplet_disk *droplet_disk_create(const struct droplet_disk_params *params);
/* Finishes writing first. Takes NULL. */
void droplet_disk_destroy(struct droplet_disk *disk);

/* Reads a struct droplet_tables or, malloc'd, a struct paper_fit_table, as the key says. Any thread. */
enum droplet_file_state droplet_disk_read(const struct droplet_disk *disk, const struct droplet_key *key, void **value);

/* Has the value written. When the disk is behind by more than it may be, the value that waits longest is not written at all. A disk that
 * fails costs one warning until it works again. Any thread, without locks that `written` takes. */
void droplet_disk_write(struct droplet_disk *disk, const struct droplet_key *key, const void *value);

/* Has the file marked as used now. Any thread. */
void droplet_disk_touch(struct droplet_disk *disk, const struct droplet_key *key);

#endif
