#include "clients/scene_source.h"

#include "clients/preset_list.h"
#include "clients/scene_edit.h"

static int take_preset(const struct client *client, const char *name, json_t **scene)
{
	json_t *presets;
	int status = preset_list_fetch(client, &presets);
	if (status == CLIENT_OK) {
		*scene = json_incref(preset_list_find(presets, name));
		status = *scene ? CLIENT_OK : CLIENT_USAGE;
	}
	json_decref(presets);
	return status;
}

bool scene_source_take(struct scene_source *source, const char *file)
{
	source->file = file;
	if (file && source->preset)
		client_error("one scene is wanted: a file, - or a preset");
	return !file || !source->preset;
}

int scene_source_load(const struct client *client, const struct scene_source *source, json_t **scene)
{
	int status = CLIENT_OK;
	*scene = NULL;
	if (source->preset)
		status = take_preset(client, source->preset, scene);
	else
		*scene = source->file ? scene_read(source->file) : json_object();
	if (status == CLIENT_OK && !*scene)
		status = CLIENT_USAGE;
	for (int i = 0; status == CLIENT_OK && i < source->sets.count; i++)
		if (!scene_set(*scene, source->sets.text[i]))
			status = CLIENT_USAGE;
	if (status != CLIENT_OK) {
		json_decref(*scene);
		*scene = NULL;
	}
	return status;
}
