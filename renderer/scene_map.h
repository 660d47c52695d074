/* A picture over the tile as the renderer reads it: plain numbers, whatever file or upload they came from.
 *
 * Made by one thread, which fills its values and calls scene_map_seal; from then on it is read only and shared by reference count. Any
 * thread.
 */
#ifndef STRATUS_RENDERER_SCENE_MAP_H
#define STRATUS_RENDERER_SCENE_MAP_H

#include <stddef.h>
#include <stdint.h>

enum { SCENE_MAP_HASH_BYTES = 16, SCENE_MAP_BINS = 32 };

/* Texels a side, at most, that the renderer keeps of a map of the ground; of one of the clouds scene_clouds.resolution. What is larger may
 * as well be averaged before it becomes a map. */
enum { SCENE_MAP_GROUND_SIDE = 2048 };

/* Part of the area that lies within one of equal ranges of value. */
struct scene_map_bin {
	double share; /* of the area, 0..1 */
	double value; /* mean of it there, 0..1 */
};

struct scene_map {
	unsigned char hash[SCENE_MAP_HASH_BYTES];  /* of the content: equal hashes, equal pictures */
	int width, height;                         /* from 1; stretched over the square tile */
	int channels;                              /* 1: share of the largest thickness; 3: reflectance at 650, 550, 450 nm. 0..1 each */
	float *values;                             /* rows from the north, texels from the west, channels interleaved */
	struct scene_map_bin bins[SCENE_MAP_BINS]; /* of the first channel */
	_Atomic int holders;
};

/* Values undefined. The caller holds it. NULL when out of memory. */
struct scene_map *scene_map_create(int width, int height, int channels, const unsigned char hash[static SCENE_MAP_HASH_BYTES]);

/* The values are complete. */
void scene_map_seal(struct scene_map *map);

/* One more, or one less, who needs it; the last frees it. Both take NULL. hold returns its argument. */
const struct scene_map *scene_map_hold(const struct scene_map *map);
void scene_map_release(const struct scene_map *map);

size_t scene_map_bytes(const struct scene_map *map);

/* The map as a texture of side x side texels wants it: row 0 in the south, resampled with periodic edges. The caller frees; NULL when out
 * of memory. */
float *scene_map_texels(const struct scene_map *map, int side);

#endif
