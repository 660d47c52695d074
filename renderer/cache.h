/* What the stages remember: results under the bytes of their inputs, least recently used out first, bounded by bytes. One thread.
 */
#ifndef STRATUS_RENDERER_CACHE_H
#define STRATUS_RENDERER_CACHE_H

#include <stdbool.h>
#include <stddef.h>

enum { CACHE_KEY_MAX = 512, CACHE_OWNERS = 8 };

/* Inputs of a result. Numbers are appended as doubles, so that no padding gets in. */
struct cache_key {
	unsigned char bytes[CACHE_KEY_MAX];
	size_t length;
};

/* Starts a key with the name of what is computed. */
struct cache_key cache_key_make(const char *name);
void cache_key_add(struct cache_key *key, double number);
/* Bytes of a hash. */
void cache_key_add_bytes(struct cache_key *key, const unsigned char *bytes, size_t count);

struct cache;

/* bound: bytes of results kept beyond those of the frame in work. NULL when out of memory. */
struct cache *cache_create(size_t bound);
void cache_destroy(struct cache *cache);

/* Results found or kept from here on are not dropped before the next call. */
void cache_begin_frame(struct cache *cache);

/* The result for a key, or NULL. Owned by the cache. */
void *cache_find(struct cache *cache, const struct cache_key *key);

/* Takes over a result, of about `bytes`; destroy(value) is called when it is dropped. false (value destroyed) when out of memory. */
bool cache_keep(struct cache *cache, const struct cache_key *key, void *value, size_t bytes, void (*destroy)(void *value));

/* Bytes of all results. */
size_t cache_bytes(const struct cache *cache);

/* Results kept from here on are counted for `owner`, 0 <= owner < CACHE_OWNERS; 0 at first. */
void cache_set_owner(struct cache *cache, int owner);
/* Of this owner's results no more than so many bytes are kept, beyond those of the frame in work; at first as many as the cache has room
 * for. */
void cache_bound_owner(struct cache *cache, int owner, size_t bytes);
/* Bytes of an owner's results. Any thread. */
size_t cache_owned_bytes(const struct cache *cache, int owner);

#endif
