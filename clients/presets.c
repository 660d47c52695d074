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
	return fflush(stdout) == 0 ? CLIENT_OK : CLIENT_UNWRITABLE;
}

static int print_scene(const json_t *presets, const char *name)
{
	const json_t *scene = preset_list_find(presets, name);
	if (!scene)
		return CLIENT_USAGE;
	json_dumpf(scene, stdout, JSON_INDENT(2));
	putchar('\n');
	return fflush(stdout) == 0 ? CLIENT_OK : CLIENT_UNWRITABLE;
}

static int run_presets(struct client *client, int argc, char **argv)
{
	static const struct option options[] = {CLIENT_LONG_OPTIONS, {0}};
	for (int option; (option = getopt_long(argc, argv, CLIENT_SHORT_OPTIONS, options, NULL)) != -1;) {
		const int end = client_option(client, option);
		if (end >= 0)
			return end;
	}
	if (argc - optind > 1) {
		client_error("presets takes one name at most");
		return CLIENT_USAGE;
	}

	json_t *presets;
	int status = preset_list_fetch(client, &presets);
	if (status == CLIENT_OK)
		status = argv[optind] ? print_scene(presets, argv[optind]) : print_list(client, presets);
	json_decref(presets);
	return status;
}

const struct command command_presets = {
	.name = "presets",
	.arguments = "[NAME]",
	.summary = "list the daemon's scenes, or print one",
	.help = "With -q the names stand alone.\n\n",
	.run = run_presets,
};
