#include "clients/scene_list.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NAME_LENGTH_MAX = 100 };

bool scene_list_add(struct scene_list *list, const char *name, json_t *scene, json_t *labels)
{
	struct scene_item item = {strdup(name), scene, labels};
	bool good = item.name && scene;
	if (good && (list->count & (list->count - 1)) == 0) { /* at every power of two there is room for as many again */
		struct scene_item *longer = realloc(list->item, (list->count ? 2 * (size_t)list->count : 1) * sizeof *longer);
		good = longer != NULL;
		list->item = longer ? longer : list->item;
	}
	if (good) {
		list->item[list->count++] = item;
		return true;
	}
	client_error("out of memory");
	free(item.name);
	json_decref(scene);
	json_decref(labels);
	return false;
}

void scene_list_finish(struct scene_list *list)
{
	for (int i = 0; i < list->count; i++) {
		free(list->item[i].name);
		json_decref(list->item[i].scene);
		json_decref(list->item[i].labels);
	}
	free(list->item);
	*list = (struct scene_list){0};
}

static bool is_name(const char *name)
{
	static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.";
	const size_t length = strlen(name);
	return length >= 1 && length <= NAME_LENGTH_MAX && name[0] != '.' && strspn(name, plain) == length;
}

/* `base` with the members of `scene` over its own. NULL: out of memory. */
static json_t *lay_over(const json_t *base, const json_t *scene)
{
	json_t *result = json_deep_copy(base), *copy = json_deep_copy(scene);
	if (result && copy && json_object_update_recursive(result, copy) != 0) {
		json_decref(result);
		result = NULL;
	}
	json_decref(copy);
	return result;
}

/* What is wrong with a line, NULL when nothing is; it is then in the list. */
static const char *take_object(struct scene_list *list, const json_t *base, json_t *line, json_t *names)
{
	char place[16];
	json_t *scene = json_object_get(line, "scene"), *labels = scene ? json_object_get(line, "labels") : NULL;
	const char *name = scene ? json_string_value(json_object_get(line, "name")) : NULL, *member;
	json_t *value;
	snprintf(place, sizeof place, "%06d", list->count + 1);
	if (scene)
		json_object_foreach(line, member, value) if (strcmp(member, "name") && strcmp(member, "scene") &&
							     strcmp(member, "labels")) return "has name, scene and labels, nothing else";
	if (scene && (!json_is_object(scene) || (labels && !json_is_object(labels))))
		return "has a scene and labels that are objects";
	if (scene && json_object_get(line, "name") && (!name || !is_name(name)))
		return "has a name of 1 to 100 letters, digits, '-', '_' and '.', the first no dot";
	name = name ? name : place;
	if (json_object_get(names, name))
		return "has a name that no other line has";
	json_object_set_new(names, name, json_true());
	return scene_list_add(list, name, lay_over(base, scene ? scene : line), json_incref(labels)) ? NULL : "was too much";
}

/* false after a message */
static bool take_line(struct scene_list *list, const json_t *base, json_t *names, const char *path, int number, const char *text)
{
	json_error_t error;
	text += strspn(text, " \t\r\n");
	if (!*text || *text == '#')
		return true;
	json_t *line = json_loads(text, JSON_REJECT_DUPLICATES, &error);
	const char *wrong = !line ? error.text : !json_is_object(line) ? "is a JSON object" : take_object(list, base, line, names);
	if (wrong)
		client_error("%s: line %d: a scene %s", path, number, wrong);
	json_decref(line);
	return !wrong;
}

int scene_list_read(const char *path, const json_t *base, struct scene_list *list)
{
	const bool standard = strcmp(path, "-") == 0;
	FILE *file = standard ? stdin : fopen(path, "re");
	json_t *names = json_object();
	char *line = NULL;
	size_t room = 0;
	bool good = file != NULL;
	if (!good)
		client_error("%s: %s", path, strerror(errno));
	for (int number = 1; good && getline(&line, &room, file) >= 0; number++)
		good = take_line(list, base, names, path, number, line);
	if (good && list->count == 0) {
		client_error("%s: there is no scene in it", path);
		good = false;
	}
	free(line);
	json_decref(names);
	if (file && !standard)
		fclose(file);
	if (!good)
		scene_list_finish(list);
	return good ? CLIENT_OK : CLIENT_USAGE;
}
