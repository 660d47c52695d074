#include "renderer/scene_map.h"

#include "renderer/resample.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

struct scene_map *scene_map_create(int width, int height, int channels, const unsigned char hash[static SCENE_MAP_HASH_BYTES])
{
	struct scene_map *map = calloc(1, sizeof *map);
	if (!map)
		return NULL;
	map->values = malloc((size_t)width * (size_t)height * (size_t)channels * sizeof *map->values);
	if (!map->values) {
		free(map);
		return NULL;
	}
	memcpy(map->hash, hash, sizeof map->hash);
	map->width = width;
	map->height = height;
	map->channels = channels;
	map->holders = 1;
	return map;
}

void scene_map_seal(struct scene_map *map)
{
	const size_t count = (size_t)map->width * (size_t)map->height;
	for (size_t i = 0; i < count; i++) {
		const double value = map->values[i * (size_t)map->channels];
		struct scene_map_bin *bin = &map->bins[(int)(fmin(fmax(value, 0), 1) * (SCENE_MAP_BINS - 1e-6))];
		bin->share += 1;
		bin->value += value;
	}
	for (int i = 0; i < SCENE_MAP_BINS; i++) {
		struct scene_map_bin *bin = &map->bins[i];
		if (bin->share > 0)
			bin->value /= bin->share;
		bin->share /= (double)count;
	}
}

const struct scene_map *scene_map_hold(const struct scene_map *map)
{
	if (map)
		((struct scene_map *)map)->holders++;
	return map;
}

void scene_map_release(const struct scene_map *map)
{
	if (!map || --((struct scene_map *)map)->holders > 0)
		return;
	free(map->values);
	free((struct scene_map *)map);
}

size_t scene_map_bytes(const struct scene_map *map)
{
	return sizeof *map + (size_t)map->width * (size_t)map->height * (size_t)map->channels * sizeof *map->values;
}

static void turn_upside_down(float *values, int side, int channels)
{
	const size_t row = (size_t)side * (size_t)channels;
	for (int y = 0; y < side / 2; y++) {
		float *upper = values + (size_t)y * row, *lower = values + (size_t)(side - 1 - y) * row;
		for (size_t i = 0; i < row; i++) {
			const float value = upper[i];
			upper[i] = lower[i];
			lower[i] = value;
		}
	}
}

float *scene_map_texels(const struct scene_map *map, int side)
{
	float *texels = resample_periodic(map->values, map->width, map->height, map->channels, side, side);
	if (texels)
		turn_upside_down(texels, side, map->channels);
	return texels;
}
