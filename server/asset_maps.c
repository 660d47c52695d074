#include "server/asset_maps.h"

#include "renderer/log.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct entry {
	struct entry *next; /* most recently used first */
	const struct scene_map *map;
	enum asset_use use;
	int side;
};

struct asset_maps {
	pthread_mutex_t mutex;
	struct entry *first;
	size_t bound, bytes;
};

struct asset_maps *asset_maps_create(size_t bytes)
{
	struct asset_maps *maps = calloc(1, sizeof *maps);
	if (!maps) {
		log_error("asset_maps_create: out of memory");
		return NULL;
	}
	pthread_mutex_init(&maps->mutex, NULL);
	maps->bound = bytes;
	return maps;
}

static void drop(struct asset_maps *maps, struct entry **link)
{
	struct entry *entry = *link;
	*link = entry->next;
	maps->bytes -= scene_map_bytes(entry->map);
	scene_map_release(entry->map);
	free(entry);
}

void asset_maps_destroy(struct asset_maps *maps)
{
	if (!maps)
		return;
	while (maps->first)
		drop(maps, &maps->first);
	pthread_mutex_destroy(&maps->mutex);
	free(maps);
}

void asset_hash_bytes(const struct asset_file *file, unsigned char bytes[static SCENE_MAP_HASH_BYTES])
{
	for (int i = 0; i < SCENE_MAP_HASH_BYTES; i++) {
		unsigned value = 0;
		sscanf(file->hash + 2 * i, "%2x", &value);
		bytes[i] = (unsigned char)value;
	}
}

/* A picture that is smaller is the same map for every larger side. */
static int side_of(const struct asset_file *file, int side)
{
	const int larger = file->facts.width > file->facts.height ? file->facts.width : file->facts.height;
	return larger < side ? larger : side;
}

/* Within the mutex. */
static struct entry **find(struct asset_maps *maps, const struct asset_file *file, enum asset_use use, int side)
{
	unsigned char hash[SCENE_MAP_HASH_BYTES];
	asset_hash_bytes(file, hash);
	struct entry **link = &maps->first;
	for (; *link; link = &(*link)->next)
		if ((*link)->use == use && (*link)->side == side_of(file, side) && memcmp((*link)->map->hash, hash, sizeof hash) == 0)
			break;
	return link;
}

const struct scene_map *asset_maps_find(struct asset_maps *maps, const struct asset_file *file, enum asset_use use, int side)
{
	pthread_mutex_lock(&maps->mutex);
	struct entry **link = find(maps, file, use, side), *entry = *link;
	if (entry) {
		*link = entry->next;
		entry->next = maps->first;
		maps->first = entry;
	}
	const struct scene_map *map = entry ? scene_map_hold(entry->map) : NULL;
	pthread_mutex_unlock(&maps->mutex);
	return map;
}

void asset_maps_keep(struct asset_maps *maps, const struct asset_file *file, enum asset_use use, int side, const struct scene_map *map)
{
	struct entry *entry = malloc(sizeof *entry);
	if (!entry)
		return;
	*entry = (struct entry){.use = use, .side = side_of(file, side), .map = map};
	pthread_mutex_lock(&maps->mutex);
	if (*find(maps, file, use, side)) {
		free(entry);
	} else {
		scene_map_hold(map);
		entry->next = maps->first;
		maps->first = entry;
		maps->bytes += scene_map_bytes(map);
	}
	pthread_mutex_unlock(&maps->mutex);
}

static bool is_held(const struct entry *entry)
{
	return entry->map->holders > 1;
}

static bool drop_oldest(struct asset_maps *maps)
{
	struct entry **oldest = NULL;
	for (struct entry **link = &maps->first; *link; link = &(*link)->next)
		if (!is_held(*link))
			oldest = link;
	if (oldest)
		drop(maps, oldest);
	return oldest;
}

static bool others_hold_any(const struct asset_maps *maps, const struct scene_map *mine)
{
	for (const struct entry *entry = maps->first; entry; entry = entry->next)
		if (is_held(entry) && entry->map != mine)
			return true;
	return false;
}

bool asset_maps_make_room(struct asset_maps *maps, const struct asset_file *file, enum asset_use use, int side,
			  const struct scene_map *mine)
{
	const size_t most = (size_t)side_of(file, side);
	const size_t needed = most * most * (use == ASSET_THICKNESS ? 1 : 3) * sizeof(float);
	pthread_mutex_lock(&maps->mutex);
	while (maps->bytes + needed > maps->bound && drop_oldest(maps))
		;
	const bool room = maps->bytes + needed <= maps->bound || !others_hold_any(maps, mine);
	pthread_mutex_unlock(&maps->mutex);
	return room;
}

size_t asset_maps_bytes(struct asset_maps *maps)
{
	pthread_mutex_lock(&maps->mutex);
	const size_t bytes = maps->bytes;
	pthread_mutex_unlock(&maps->mutex);
	return bytes;
}
