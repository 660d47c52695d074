/* stratus presets [NAME]: the names of the daemon's scenes, or one of them. */
#include "clients/commands.h"
#include "clients/preset_list.h"

#include <stdio.h>

static const char *text(const json_t *preset, const char *name)
{
	const char *found = json_string_value(json_object_get(preset, name));
	return found ? found : "";
}

static int print_list(const struct client *client, const json_t *presets)
{
	size_t i;
	json_t *preset;
	json_array_foreach(presets, i, preset)
	{
		if (client->quiet)
			puts(text(preset, "name"));
		else
			printf("%-18s %s\n", text(preset, "name"), text(preset, "title"));
	}
	return client_end_output();
}

static int print_scene(const json_t *presets, const char *name)
{
	const json_t *scene = preset_list_find(presets, name);
	if (!scene)
		return CLIENT_USAGE;
	json_dumpf(scene, stdout, JSON_INDENT(2));
	putchar('\n');
	return client_end_output();
}

static int run_presets(struct client *client, void *options, char **words)
{
	json_t *presets;
	(void)options;
	int status = preset_list_fetch(client, &presets);
	if (status == CLIENT_OK)
		status = words[0] ? print_scene(presets, words[0]) : print_list(client, presets);
	json_decref(presets);
	return status;
}

const struct command command_presets = {
	.name = "presets",
	.arguments = "[NAME]",
	.summary = "list the daemon's scenes, or print one",
	.remarks = "With -q the names stand alone.\n",
	.words_max = 1,
	.words = WORDS_PRESET,
	.run = run_presets,
};
