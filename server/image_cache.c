#include "server/image_cache.h"

#include "renderer/log.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

/* An image of the smallest size takes about a kilobyte, a usual one a hundred: chains stay short in either case. */
enum { BUCKET_BYTES = 16 << 10, BUCKETS_LEAST = 64, BUCKETS_MOST = 65536 };

/* What the heap adds to each of an image's two pieces, about. */
enum { HEAP_BYTES = 2 * 16 };

struct image_cache {
	pthread_mutex_t mutex;
	struct finished_image *newest, *oldest;
	struct image_cache_counts counts;
	size_t bucket_count;
	struct finished_image *buckets[];
};

/* --- images ----------------------------------------------------------------------------------------------------------------------- */

struct finished_image *finished_image_create(const char *tag, unsigned char *data, size_t size, double pixels, int samples)
{
	struct finished_image *image = calloc(1, sizeof *image);
	if (!image) {
		log_error("finished_image_create: out of memory");
		free(data);
		return NULL;
	}
	image->holders = 1;
	strncpy(image->tag, tag, sizeof image->tag - 1);
	image->data = data;
	image->size = size;
	image->pixels = pixels;
	image->samples = samples;
	return image;
}

struct finished_image *finished_image_hold(struct finished_image *image)
{
	image->holders++;
	return image;
}

void finished_image_release(struct finished_image *image)
{
	if (!image || --image->holders > 0)
		return;
	free(image->data);
	free(image);
}

static size_t bytes_of(const struct finished_image *image)
{
	return image->size + sizeof *image + HEAP_BYTES;
}

/* --- life ------------------------------------------------------------------------------------------------------------------------- */

struct image_cache *image_cache_create(size_t bound)
{
	size_t buckets = BUCKETS_LEAST;
	while (buckets < BUCKETS_MOST && buckets < bound / BUCKET_BYTES)
		buckets *= 2;
	struct image_cache *cache = calloc(1, sizeof *cache + buckets * sizeof *cache->buckets);
	if (!cache) {
		log_error("image_cache_create: out of memory");
		return NULL;
	}
	pthread_mutex_init(&cache->mutex, NULL);
	cache->counts.bound = bound;
	cache->bucket_count = buckets;
	return cache;
}

void image_cache_destroy(struct image_cache *cache)
{
	if (!cache)
		return;
	for (struct finished_image *image = cache->oldest, *newer; image; image = newer) {
		newer = image->newer;
		finished_image_release(image);
	}
	pthread_mutex_destroy(&cache->mutex);
	free(cache);
}

/* --- within the mutex --------------------------------------------------------------------------------------------------------------- */

/* The link that leads to the image of a tag, or to the end of its chain. Tags are digests, but nothing here depends on it (FNV-1a). */
static struct finished_image **find_link(struct image_cache *cache, const char *tag)
{
	uint64_t hash = 0xcbf29ce484222325;
	for (const char *c = tag; *c; c++)
		hash = (hash ^ (unsigned char)*c) * 0x100000001b3;
	struct finished_image **link = &cache->buckets[hash & (cache->bucket_count - 1)];
	while (*link && strcmp((*link)->tag, tag) != 0)
		link = &(*link)->chained;
	return link;
}

static void unlink_from_order(struct image_cache *cache, struct finished_image *image)
{
	*(image->newer ? &image->newer->older : &cache->newest) = image->older;
	*(image->older ? &image->older->newer : &cache->oldest) = image->newer;
}

static void make_newest(struct image_cache *cache, struct finished_image *image)
{
	image->newer = NULL;
	image->older = cache->newest;
	*(cache->newest ? &cache->newest->newer : &cache->oldest) = image;
	cache->newest = image;
}

/* Drops the oldest until so many bytes are free; what is dropped is chained, for its release without the mutex. */
static struct finished_image *make_room(struct image_cache *cache, size_t bytes)
{
	struct finished_image *dropped = NULL;
	while (cache->counts.bytes + bytes > cache->counts.bound) {
		struct finished_image *image = cache->oldest;
		struct finished_image **link = find_link(cache, image->tag);
		*link = image->chained;
		unlink_from_order(cache, image);
		cache->counts.bytes -= bytes_of(image);
		cache->counts.images--;
		cache->counts.evicted++;
		image->chained = dropped;
		dropped = image;
	}
	return dropped;
}

static void release_chain(struct finished_image *dropped)
{
	for (struct finished_image *next; dropped; dropped = next) {
		next = dropped->chained;
		finished_image_release(dropped);
	}
}

/* --- from outside ------------------------------------------------------------------------------------------------------------------- */

struct finished_image *image_cache_find(struct image_cache *cache, const char *tag)
{
	pthread_mutex_lock(&cache->mutex);
	struct finished_image *image = *find_link(cache, tag);
	if (image) {
		unlink_from_order(cache, image);
		make_newest(cache, image);
		finished_image_hold(image);
	}
	pthread_mutex_unlock(&cache->mutex);
	return image;
}

bool image_cache_keep(struct image_cache *cache, struct finished_image *image)
{
	struct finished_image *dropped = NULL;
	const size_t bytes = bytes_of(image);
	if (bytes > cache->counts.bound) /* which does not change */
		return false;
	pthread_mutex_lock(&cache->mutex);
	struct finished_image *kept = *find_link(cache, image->tag);
	if (kept) { /* rendered twice, with the same bytes */
		unlink_from_order(cache, kept);
		make_newest(cache, kept);
	} else {
		dropped = make_room(cache, bytes);
		*find_link(cache, image->tag) = finished_image_hold(image);
		image->chained = NULL;
		make_newest(cache, image);
		cache->counts.bytes += bytes;
		cache->counts.images++;
	}
	pthread_mutex_unlock(&cache->mutex);
	release_chain(dropped);
	return true;
}

void image_cache_clear(struct image_cache *cache)
{
	pthread_mutex_lock(&cache->mutex);
	struct finished_image *dropped = make_room(cache, cache->counts.bound);
	pthread_mutex_unlock(&cache->mutex);
	release_chain(dropped);
}

struct image_cache_counts image_cache_counts(struct image_cache *cache)
{
	pthread_mutex_lock(&cache->mutex);
	const struct image_cache_counts counts = cache->counts;
	pthread_mutex_unlock(&cache->mutex);
	return counts;
}
