#include "renderer/cache.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

struct entry {
	struct entry *next; /* most recently used first */
	struct cache_key key;
	void *value;
	size_t bytes;
	void (*destroy)(void *value);
	unsigned long frame; /* last one that used it */
	int owner;
};

/* A few dozen entries at most: a list is searched faster than the key could be hashed. */
struct cache {
	struct entry *first;
	size_t bound, bytes;
	size_t owner_bound[CACHE_OWNERS];
	unsigned long frame;
	int owner;
	_Atomic size_t owned[CACHE_OWNERS];
};

struct cache_key cache_key_make(const char *name)
{
	struct cache_key key = {.length = strlen(name) + 1};
	memcpy(key.bytes, name, key.length);
	return key;
}

void cache_key_add_bytes(struct cache_key *key, const unsigned char *bytes, size_t count)
{
	/* A key that is too long is our bug; the abort is better than two scenes sharing one result. */
	if (key->length + count > CACHE_KEY_MAX)
		abort();
	memcpy(key->bytes + key->length, bytes, count);
	key->length += count;
}

void cache_key_add(struct cache_key *key, double number)
{
	unsigned char bytes[sizeof number];
	number += 0.0; /* -0 becomes 0 */
	memcpy(bytes, &number, sizeof number);
	cache_key_add_bytes(key, bytes, sizeof bytes);
}

struct cache *cache_create(size_t bound)
{
	struct cache *cache = calloc(1, sizeof *cache);
	for (int i = 0; cache && i < CACHE_OWNERS; i++)
		cache->owner_bound[i] = bound;
	if (cache)
		cache->bound = bound;
	return cache;
}

static void drop(struct cache *cache, struct entry **link)
{
	struct entry *entry = *link;
	*link = entry->next;
	cache->bytes -= entry->bytes;
	cache->owned[entry->owner] -= entry->bytes;
	entry->destroy(entry->value);
	free(entry);
}

void cache_destroy(struct cache *cache)
{
	if (!cache)
		return;
	while (cache->first)
		drop(cache, &cache->first);
	free(cache);
}

/* What goes first: a result that takes half of the bound for itself (a huge picture) would drive out all that others share; else the least
 * recently used. */
static struct entry **next_to_drop(struct cache *cache)
{
	struct entry **oldest = NULL;
	for (struct entry **link = &cache->first; *link; link = &(*link)->next) {
		if ((*link)->frame == cache->frame)
			continue;
		if ((*link)->bytes > cache->bound / 2)
			return link;
		oldest = link;
	}
	return oldest;
}

static struct entry **oldest_of(struct cache *cache, int owner)
{
	struct entry **oldest = NULL;
	for (struct entry **link = &cache->first; *link; link = &(*link)->next)
		if ((*link)->owner == owner && (*link)->frame != cache->frame)
			oldest = link;
	return oldest;
}

static void shrink(struct cache *cache)
{
	struct entry **link;
	for (int i = 0; i < CACHE_OWNERS; i++)
		while (cache->owned[i] > cache->owner_bound[i] && (link = oldest_of(cache, i)))
			drop(cache, link);
	while (cache->bytes > cache->bound && (link = next_to_drop(cache)))
		drop(cache, link);
}

void cache_begin_frame(struct cache *cache)
{
	cache->frame++;
	shrink(cache);
}

void *cache_find(struct cache *cache, const struct cache_key *key)
{
	for (struct entry **link = &cache->first; *link; link = &(*link)->next) {
		struct entry *entry = *link;
		if (entry->key.length != key->length || memcmp(entry->key.bytes, key->bytes, key->length) != 0)
			continue;
		*link = entry->next;
		entry->next = cache->first;
		cache->first = entry;
		entry->frame = cache->frame;
		return entry->value;
	}
	return NULL;
}

bool cache_keep(struct cache *cache, const struct cache_key *key, void *value, size_t bytes, void (*destroy)(void *value))
{
	struct entry *entry = calloc(1, sizeof *entry);
	if (!entry) {
		destroy(value);
		return false;
	}
	*entry = (struct entry){.next = cache->first,
				.key = *key,
				.value = value,
				.bytes = bytes,
				.destroy = destroy,
				.frame = cache->frame,
				.owner = cache->owner};
	cache->first = entry;
	cache->bytes += bytes;
	cache->owned[cache->owner] += bytes;
	shrink(cache);
	return true;
}

size_t cache_bytes(const struct cache *cache)
{
	return cache->bytes;
}

void cache_set_owner(struct cache *cache, int owner)
{
	cache->owner = owner;
}

void cache_bound_owner(struct cache *cache, int owner, size_t bytes)
{
	cache->owner_bound[owner] = bytes;
}

size_t cache_owned_bytes(const struct cache *cache, int owner)
{
	return cache->owned[owner];
}
