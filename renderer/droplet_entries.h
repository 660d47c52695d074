/* What a droplet store has in memory: a list, bounded by bytes, least recently used out first. One thread at a time. Private to
 * renderer/droplet_store.c.
 */
#ifndef STRATUS_RENDERER_DROPLET_ENTRIES_H
#define STRATUS_RENDERER_DROPLET_ENTRIES_H

#include "renderer/optics/droplet_file.h"

#include <time.h>

/* Tables or fit of one distribution. */
struct droplet_entry {
	struct droplet_entry *next; /* most recently used first */
	struct droplet_key key;
	enum { DROPLET_OBTAINING, DROPLET_READY, DROPLET_FAILED } state; /* OBTAINING: by the first who asked for it */
	void *value;                                                     /* struct droplet_tables or, malloc'd, struct paper_fit_table */
	size_t bytes;
	int holds;    /* by users and by those who wait */
	bool writing; /* waits for the disk */
	time_t touched;
};

struct droplet_entries {
	struct droplet_entry *first;
	int count;
	size_t bytes, held_bytes, bound;
};

/* The entry of a key, which counts as used now, or NULL. */
struct droplet_entry *droplet_entries_find(struct droplet_entries *entries, const struct droplet_key *key);
/* The entry whose value this is; there must be one. */
struct droplet_entry *droplet_entries_of(const struct droplet_entries *entries, const void *value);
/* A new entry for a key that has none: being obtained, not held. NULL when out of memory. */
struct droplet_entry *droplet_entries_add(struct droplet_entries *entries, const struct droplet_key *key);

void droplet_entries_hold(struct droplet_entries *entries, struct droplet_entry *entry);
/* A failed entry is gone when nobody holds it any more. */
void droplet_entries_unhold(struct droplet_entries *entries, struct droplet_entry *entry);

/* Of a held entry that is being obtained. NULL: it failed, and is found no longer. */
void droplet_entries_settle(struct droplet_entries *entries, struct droplet_entry *entry, void *value);

/* Does the bound have room for so much beside what is held? */
bool droplet_entries_have_room(const struct droplet_entries *entries, size_t bytes);

/* Takes what exceeds the bound and can be spared out of the list, for droplet_entries_free without a lock: giving 15 MB back takes its
 * time. */
struct droplet_entry *droplet_entries_excess(struct droplet_entries *entries);
/* Frees a list of entries with their values. Takes NULL. */
void droplet_entries_free(struct droplet_entry *entry);

#endif
