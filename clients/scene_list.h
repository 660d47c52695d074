/* Scenes by the number, each with a name: read from a file of lines, or drawn at random. */
#ifndef STRATUS_CLIENTS_SCENE_LIST_H
#define STRATUS_CLIENTS_SCENE_LIST_H

#include "clients/client.h"

#include <jansson.h>

struct scene_item {
	char *name; /* letters, digits, '-', '_' and '.': good for a file */
	json_t *scene;
	json_t *labels; /* an object, or NULL */
};

struct scene_list {
	struct scene_item *item;
	int count;
};

enum { SCENE_LIST_MAX = 10000000 };

/* Reads JSON objects, one a line ("-": standard input); lines that are empty or begin with # are left out. Each is a scene, or
 * {"name": "...", "scene": {...}, "labels": {...}}; without a name it is called by its place, 000001. A scene is laid over `base`, member
 * by member. An enum client_exit, after a message that names the line; the list is empty then. */
int scene_list_read(const char *path, const json_t *base, struct scene_list *list);

/* `count` copies of base in which members are drawn anew: "sun.elevation_deg=5.0..60.0" evenly between the two (whole numbers between whole
 * ones), "clouds.type=stratus,altocumulus" one of these. Labels are what was drawn. The first n of a seed are the same whatever the count.
 */
int scene_list_draw(const json_t *base, const struct text_list *vary, int count, double seed, struct scene_list *list);

/* Adds one; takes the references of scene and labels, NULL too. false after a message. */
bool scene_list_add(struct scene_list *list, const char *name, json_t *scene, json_t *labels);

void scene_list_finish(struct scene_list *list);

#endif
