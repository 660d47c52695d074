#include "server/scene_assets.h"

#include "renderer/log.h"
#include "server/clock.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { CLOUDS, GROUND };
enum { ROOM_MS = 5 }; /* how often one that waits for room looks again */

static const struct {
	const char *pointer, *hash_pointer;
	enum asset_use use;
} members[SCENE_ASSETS_COUNT] = {
	[CLOUDS] = {"/clouds/map", "/clouds/map_hash", ASSET_THICKNESS},
	[GROUND] = {"/ground/map", "/ground/map_hash", ASSET_ALBEDO},
};

static struct scene_map_choice *choice_of(struct scene *scene, int i)
{
	return i == CLOUDS ? &scene->clouds.map : &scene->ground.map;
}

static int side_of(const struct scene *scene, int i)
{
	return i == CLOUDS ? scene->clouds.resolution : SCENE_MAP_GROUND_SIDE;
}

static void check_thickness(const struct asset_facts *facts, struct problem *problem)
{
	if (!(facts->lowest[ASSET_THICKNESS] >= 0 && facts->highest[ASSET_THICKNESS] <= 1))
		problem_add(problem, "/clouds/map", "holds values from %.4g to %.4g: from 0 to 1, the share of thickness_m",
			    (double)facts->lowest[ASSET_THICKNESS], (double)facts->highest[ASSET_THICKNESS]);
}

static void check_albedo(const struct asset_facts *facts, double scale, struct problem *problem)
{
	const double highest = facts->highest[ASSET_ALBEDO];
	if (!(facts->lowest[ASSET_ALBEDO] >= 0 && highest <= 1))
		problem_add(problem, "/ground/map", "holds reflectances from %.4g to %.4g: from 0 to 1",
			    (double)facts->lowest[ASSET_ALBEDO], highest);
	else if (highest * scale > 1)
		problem_add(problem, "/ground/albedo_scale",
			    "times the map's largest reflectance, %.4g, exceeds 1: at most %.6g for this map", highest,
			    floor(1e3 / highest) * 1e-3);
}

static void find(struct asset_store *store, struct scene *scene, int i, struct asset_file *file, struct problem *problem)
{
	struct scene_map_choice *choice = choice_of(scene, i);
	if (!*choice->name || problem_mentions(problem, members[i].pointer))
		return;
	const enum asset_result result = asset_store_open(store, choice->name, file);
	if (result == ASSET_FAILED)
		problem_set(problem, PROBLEM_INTERNAL, "The asset %s cannot be read.", choice->name);
	if (result == ASSET_MISSING)
		problem_add(problem, members[i].pointer, "there is no asset of this name; PUT /v1/assets/%s would make it", choice->name);
	if (result != ASSET_OK)
		return;
	if (*choice->hash && strcmp(choice->hash, file->hash) != 0)
		problem_add(problem, members[i].hash_pointer, "is not what the asset %s holds now, %s", choice->name, file->hash);
	memcpy(choice->hash, file->hash, sizeof file->hash);
	if (i == CLOUDS)
		check_thickness(&file->facts, problem);
	else
		check_albedo(&file->facts, scene->ground.albedo_scale, problem);
}

void scene_assets_init(struct scene_assets *assets)
{
	for (int i = 0; i < SCENE_ASSETS_COUNT; i++)
		assets->file[i].fd = -1;
}

void scene_assets_find(struct asset_store *store, struct scene *scene, struct scene_assets *assets, struct problem *problem)
{
	for (int i = 0; i < SCENE_ASSETS_COUNT; i++)
		find(store, scene, i, &assets->file[i], problem);
}

void scene_assets_use_mean_ground(struct scene *scene, const struct scene_assets *assets)
{
	for (int band = 0; *scene->ground.map.name && band < 3; band++)
		scene->ground.albedo[band] = (double)assets->file[GROUND].facts.mean_albedo[band];
}

bool scene_assets_take(struct asset_maps *maps, struct scene *scene, struct scene_assets *assets)
{
	bool complete = true;
	for (int i = 0; i < SCENE_ASSETS_COUNT; i++) {
		struct scene_map_choice *choice = choice_of(scene, i);
		if (!*choice->name || choice->map)
			continue;
		choice->map = asset_maps_find(maps, &assets->file[i], members[i].use, side_of(scene, i));
		if (choice->map)
			asset_file_close(&assets->file[i]);
		else
			complete = false;
	}
	return complete;
}

static bool decode(struct asset_maps *maps, struct decoder *decoder, struct scene *scene, int i, struct asset_file *file,
		   double deadline_ms)
{
	unsigned char hash[SCENE_MAP_HASH_BYTES];
	char error[256] = "see above";
	struct scene_map *map;
	struct scene_map_choice *choice = choice_of(scene, i);
	asset_hash_bytes(file, hash);
	const enum decoder_result result = decoder_read_map(decoder, file->fd, file->bytes, deadline_ms, &file->facts, members[i].use,
							    side_of(scene, i), hash, &map, error, sizeof error);
	choice->map = map;
	if (map)
		asset_maps_keep(maps, file, members[i].use, side_of(scene, i), map);
	else if (result != DECODER_LATE)
		log_error("asset %s, which could be read before: %s", choice->name, error);
	asset_file_close(file);
	return map;
}

bool scene_assets_decode(struct asset_maps *maps, struct decoder *decoder, struct scene *scene, struct scene_assets *assets,
			 bool (*is_over)(void *context), void *context, double deadline_ms, double milliseconds[SCENE_ASSETS_COUNT])
{
	for (int i = 0; i < SCENE_ASSETS_COUNT; i++) {
		const struct scene_map *mine = scene->clouds.map.map;
		/* Another scene may have brought it in the meantime. */
		if (scene_assets_take(maps, scene, assets))
			return true;
		if (!*choice_of(scene, i)->name || choice_of(scene, i)->map)
			continue;
		while (!is_over(context) && !asset_maps_make_room(maps, &assets->file[i], members[i].use, side_of(scene, i), mine))
			usleep(ROOM_MS * 1000);
		if (is_over(context))
			return false;
		const double begin = clock_now_ms();
		if (!decode(maps, decoder, scene, i, &assets->file[i], deadline_ms)) {
			is_over(context);
			return false;
		}
		milliseconds[i] = clock_now_ms() - begin;
	}
	return true;
}

void scene_assets_release(struct scene *scene)
{
	for (int i = 0; i < SCENE_ASSETS_COUNT; i++) {
		scene_map_release(choice_of(scene, i)->map);
		choice_of(scene, i)->map = NULL;
	}
}

void scene_assets_finish(struct scene *scene, struct scene_assets *assets)
{
	scene_assets_release(scene);
	for (int i = 0; i < SCENE_ASSETS_COUNT; i++)
		asset_file_close(&assets->file[i]);
}
