/* The maps that a scene names: found when it is read, decoded before it is rendered, held while it is. One thread at a time. */
#ifndef STRATUS_SERVER_SCENE_ASSETS_H
#define STRATUS_SERVER_SCENE_ASSETS_H

#include "server/asset_maps.h"
#include "server/decoder.h"
#include "server/problem.h"

enum { SCENE_ASSETS_COUNT = 2 };

struct scene_assets {
	struct asset_file file[SCENE_ASSETS_COUNT]; /* of the clouds, of the ground; open until the map is there */
};

/* None found yet. */
void scene_assets_init(struct scene_assets *assets);

/* Finds the pictures behind the names of a scene that obeys the other rules, notes in it what they hold, and adds to the problem what
 * speaks against them. scene_assets_finish in any case. */
void scene_assets_find(struct asset_store *store, struct scene *scene, struct scene_assets *assets, struct problem *problem);

/* For what depends on the mean of the ground alone: gives the scene a Lambertian ground of the map's mean reflectance. */
void scene_assets_use_mean_ground(struct scene *scene, const struct scene_assets *assets);

/* Takes from memory what is there. true when nothing is missing. */
bool scene_assets_take(struct asset_maps *maps, struct scene *scene, struct scene_assets *assets);

/* Decodes what is missing, waiting for memory that other scenes hold for as long as `is_over` says false. deadline_ms: when that will say
 * true at the latest. milliseconds: what decoding took. false when it is over (is_over was asked last then), or (with a log line) a file
 * cannot be read any more. */
bool scene_assets_decode(struct asset_maps *maps, struct decoder *decoder, struct scene *scene, struct scene_assets *assets,
			 bool (*is_over)(void *context), void *context, double deadline_ms, double milliseconds[SCENE_ASSETS_COUNT]);

/* The scene is rendered: lets its maps go. Once or more. */
void scene_assets_release(struct scene *scene);
void scene_assets_finish(struct scene *scene, struct scene_assets *assets);

#endif
