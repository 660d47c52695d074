/* Decoded pictures in memory, by what they hold and not by their names; least recently used out first, bounded by bytes. Any thread. */
#ifndef STRATUS_SERVER_ASSET_MAPS_H
#define STRATUS_SERVER_ASSET_MAPS_H

#include "server/asset_store.h"

struct asset_maps;

/* bytes: bound of what is kept and held together. NULL (and a log line) when out of memory. */
struct asset_maps *asset_maps_create(size_t bytes);
/* Every map must have been released. Takes NULL. */
void asset_maps_destroy(struct asset_maps *maps);

/* A map of at most side x side values when it is in memory; the caller releases it (scene_map_release). Else NULL. */
const struct scene_map *asset_maps_find(struct asset_maps *maps, const struct asset_file *file, enum asset_use use, int side);

/* Keeps a map that was decoded from the file. The caller goes on holding it. */
void asset_maps_keep(struct asset_maps *maps, const struct asset_file *file, enum asset_use use, int side, const struct scene_map *map);

/* Drops what nobody holds as far as that is needed for one more such map. false when it takes others' letting go, too; `mine` (or NULL) is
 * held by the caller, who will not. */
bool asset_maps_make_room(struct asset_maps *maps, const struct asset_file *file, enum asset_use use, int side,
			  const struct scene_map *mine);

/* Bytes of all maps. */
size_t asset_maps_bytes(struct asset_maps *maps);

/* The hash of a file's content, as bytes. */
void asset_hash_bytes(const struct asset_file *file, unsigned char bytes[static SCENE_MAP_HASH_BYTES]);

#endif
