/* Finished images in memory, under their entity tags: a strong tag names all that decides about an image's bytes, so what lies under it can
 * be answered whoever asks, by POST or by GET. Least recently used out first, bounded by bytes. Any thread; nothing is computed, read or
 * freed while others wait.
 */
#ifndef STRATUS_SERVER_IMAGE_CACHE_H
#define STRATUS_SERVER_IMAGE_CACHE_H

#include "server/entity_tag.h"

#include <stdbool.h>
#include <stdint.h>

/* An encoded image. Does not change; freed by the last of its holders: the cache, who waits for it, each answer that is sent from it. */
struct finished_image {
	_Atomic unsigned holders;
	char tag[ENTITY_TAG_SIZE];
	unsigned char *data; /* malloc'd */
	size_t size;
	double pixels;                                  /* layers counted apart */
	int samples;                                    /* of a reference: light paths behind every pixel, at least; else 0 */
	struct finished_image *chained, *newer, *older; /* of the cache */
};

/* Takes over `data`, also on failure. NULL (and a log line) when out of memory. */
struct finished_image *finished_image_create(const char *tag, unsigned char *data, size_t size, double pixels, int samples);
struct finished_image *finished_image_hold(struct finished_image *image);
/* Takes NULL. */
void finished_image_release(struct finished_image *image);

struct image_cache;

/* bound: bytes of images, and of what it takes to keep them; 0: none are kept. NULL (and a log line) on failure. */
struct image_cache *image_cache_create(size_t bound);
/* Takes NULL. Images that others hold stay theirs. */
void image_cache_destroy(struct image_cache *cache);

/* The image of a tag, which the caller releases; NULL when it is not there. */
struct finished_image *image_cache_find(struct image_cache *cache, const char *tag);

/* Holds the image as long as there is room. false when it is larger than all the room there is. */
bool image_cache_keep(struct image_cache *cache, struct finished_image *image);

/* Drops all images, which counts as eviction. */
void image_cache_clear(struct image_cache *cache);

struct image_cache_counts {
	size_t images, bytes, bound;
	uint64_t evicted; /* for want of room, since the cache was made */
};
struct image_cache_counts image_cache_counts(struct image_cache *cache);

#endif
