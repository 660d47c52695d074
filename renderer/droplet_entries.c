#include "renderer/droplet_entries.h"

#include <stdlib.h>

/* Fits are so small that bytes alone would let them become too many to search: a list with the most recent first is searched faster than
 * a key could be hashed as long as it is short. */
enum { COUNT_MAX = 512 };

struct droplet_entry *droplet_entries_find(struct droplet_entries *entries, const struct droplet_key *key)
{
	for (struct droplet_entry **link = &entries->first; *link; link = &(*link)->next) {
		struct droplet_entry *entry = *link;
		if (!droplet_key_equal(&entry->key, key))
			continue;
		*link = entry->next;
		entry->next = entries->first;
		entries->first = entry;
		return entry;
	}
	return NULL;
}

struct droplet_entry *droplet_entries_of(const struct droplet_entries *entries, const void *value)
{
	struct droplet_entry *entry = entries->first;
	while (entry->value != value)
		entry = entry->next;
	return entry;
}

struct droplet_entry *droplet_entries_add(struct droplet_entries *entries, const struct droplet_key *key)
{
	struct droplet_entry *entry = calloc(1, sizeof *entry);
	if (!entry)
		return NULL;
	entry->key = *key;
	entry->next = entries->first;
	entries->first = entry;
	entries->count++;
	return entry;
}

void droplet_entries_hold(struct droplet_entries *entries, struct droplet_entry *entry)
{
	if (entry->holds++ == 0)
		entries->held_bytes += entry->bytes;
}

void droplet_entries_unhold(struct droplet_entries *entries, struct droplet_entry *entry)
{
	if (--entry->holds > 0)
		return;
	entries->held_bytes -= entry->bytes;
	if (entry->state == DROPLET_FAILED)
		free(entry);
}

static void unlink_entry(struct droplet_entries *entries, struct droplet_entry *entry)
{
	struct droplet_entry **link = &entries->first;
	while (*link != entry)
		link = &(*link)->next;
	*link = entry->next;
	entries->count--;
	entries->bytes -= entry->bytes;
}

void droplet_entries_settle(struct droplet_entries *entries, struct droplet_entry *entry, void *value)
{
	if (!value) {
		unlink_entry(entries, entry);
		entry->state = DROPLET_FAILED;
		return;
	}
	entry->state = DROPLET_READY;
	entry->value = value;
	entry->bytes = entry->key.kind == DROPLET_TABLES ? ((struct droplet_tables *)value)->bytes : sizeof(struct paper_fit_table);
	entries->bytes += entry->bytes;
	entries->held_bytes += entry->bytes;
}

bool droplet_entries_have_room(const struct droplet_entries *entries, size_t bytes)
{
	return entries->held_bytes == 0 || entries->held_bytes + bytes <= entries->bound;
}

static struct droplet_entry *least_recently_used(const struct droplet_entries *entries)
{
	struct droplet_entry *last = NULL;
	for (struct droplet_entry *entry = entries->first; entry; entry = entry->next)
		if (entry->state == DROPLET_READY && entry->holds == 0 && !entry->writing)
			last = entry;
	return last;
}

struct droplet_entry *droplet_entries_excess(struct droplet_entries *entries)
{
	struct droplet_entry *excess = NULL, *entry;
	while ((entries->bytes > entries->bound || entries->count > COUNT_MAX) && (entry = least_recently_used(entries))) {
		unlink_entry(entries, entry);
		entry->next = excess;
		excess = entry;
	}
	return excess;
}

void droplet_entries_free(struct droplet_entry *entry)
{
	while (entry) {
		struct droplet_entry *next = entry->next;
		if (entry->key.kind == DROPLET_TABLES)
			droplet_tables_destroy(entry->value);
		else
			free(entry->value);
		free(entry);
		entry = next;
	}
}
