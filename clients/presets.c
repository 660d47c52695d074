/* stratus presets [NAME]: the names of the daemon's scenes, or one of them. */
#include "clients/commands.h"
#include "clients/preset_list.h"

#include <stdio.h>

static int print_presets(const json_t *presets, const char *wanted)
{
	const char *name;
	json_t *scene;
	if (wanted) {
		scene = json_object_get(presets, wanted);
		if (!scene) {
			client_error("there is no preset \"%s\"; stratus presets lists them", wanted);
			return CLIENT_USAGE;
		}
		json_dumpf(scene, stdout, JSON_INDENT(2));
		putchar('\n');
	} else {
		json_object_foreach((json_t *)presets, name, scene)
		{
			puts(name);
		}
	}
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
		status = print_presets(presets, argv[optind]);
	json_decref(presets);
	return status;
}

const struct command command_presets = {
	.name = "presets",
	.arguments = "[NAME]",
	.summary = "list the daemon's scenes, or print one",
	.help = "",
	.run = run_presets,
};
