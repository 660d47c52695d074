#include "clients/scene_edit.h"

#include "clients/client.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

json_t *scene_read(const char *path)
{
	json_error_t error;
	const bool standard = strcmp(path, "-") == 0;
	FILE *file = standard ? stdin : fopen(path, "rb");
	if (!file) {
		client_error("%s: %s", path, strerror(errno));
		return NULL;
	}
	json_t *scene = json_loadf(file, JSON_REJECT_DUPLICATES, &error);
	if (!standard)
		fclose(file);
	if (!scene) {
		client_error("%s: line %d, column %d: %s", standard ? "standard input" : path, error.line, error.column, error.text);
	} else if (!json_is_object(scene)) {
		client_error("%s: a scene is a JSON object", path);
		json_decref(scene);
		scene = NULL;
	}
	return scene;
}

/* The object that holds the last name of a dotted path; moves *path to that name. NULL when a value stands in the way. */
static json_t *descend(json_t *object, char **path)
{
	for (char *dot; (dot = strchr(*path, '.')); *path = dot + 1) {
		*dot = '\0';
		json_t *inner = json_object_get(object, *path);
		if (!inner && json_object_set_new(object, *path, json_object()) == 0)
			inner = json_object_get(object, *path);
		if (!json_is_object(inner))
			return NULL;
		object = inner;
	}
	return object;
}

static json_t *parse_value(const char *text)
{
	json_t *value = json_loads(text, JSON_DECODE_ANY | JSON_REJECT_DUPLICATES, NULL);
	return value ? value : json_string(text);
}

bool scene_set(json_t *scene, const char *assignment)
{
	char *copy = strdup(assignment), *path = copy;
	char *equals = copy ? strchr(copy, '=') : NULL;
	bool done = false;
	if (!equals || equals == copy || copy[0] == '.' || equals[-1] == '.') {
		client_error("member=value is wanted, not \"%s\"", assignment);
		goto cleanup;
	}
	*equals = '\0';
	json_t *object = descend(scene, &path);
	done = object && json_object_set_new(object, path, parse_value(equals + 1)) == 0;
	if (!done)
		client_error("%s: a value that is no object stands in the way, or the text is not UTF-8", assignment);
cleanup:
	free(copy);
	return done;
}

const char *scene_format_of(const char *path)
{
	const char *dot = strrchr(path, '.');
	return !dot ? NULL : strcasecmp(dot, ".png") == 0 ? "png" : strcasecmp(dot, ".exr") == 0 ? "exr" : NULL;
}

bool scene_set_format(json_t *scene, const char *path, bool anyway)
{
	const char *format = scene_format_of(path);
	json_t *output = json_object_get(scene, "output");
	if (!format || (output && !json_is_object(output)) || (!anyway && json_object_get(output, "format")))
		return true; /* nothing to add; what is wrong with it, the server says */
	if (output)
		return json_object_set_new(output, "format", json_string(format)) == 0;
	return json_object_set_new(scene, "output", json_pack("{s:s}", "format", format)) == 0;
}
