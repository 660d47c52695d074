/* stratus optics: what a droplet size distribution does to light. */
#include "clients/commands.h"
#include "clients/http.h"
#include "clients/optics_text.h"
#include "clients/plot.h"
#include "clients/problem.h"
#include "clients/scene_source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct optics_options {
	struct scene_source source;
	const char *output;
	bool json, plot;
};

/* Appends &section.member=value of a scene's numbers and words. */
static void write_members(FILE *query, const json_t *scene, const char *section, const char *only)
{
	const char *member;
	json_t *value;
	json_object_foreach(json_object_get(scene, section), member, value)
	{
		if (only && strcmp(member, only) != 0)
			continue;
		char *text = json_is_string(value) ? strdup(json_string_value(value)) : json_dumps(value, JSON_ENCODE_ANY | JSON_COMPACT);
		for (char *at = text; at && *at; at++)
			if (!strchr("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.+,", *at))
				*at = '_'; /* no value of these members has such letters: the daemon refuses it */
		fprintf(query, "&%s.%s=%s", section, member, text ? text : "");
		free(text);
	}
}

static int fetch(const struct client *client, const json_t *scene, json_t **optics)
{
	struct http_response response;
	char *path = NULL;
	size_t size;
	FILE *query = open_memstream(&path, &size);
	fputs("/v1/optics?", query);
	write_members(query, scene, "dsd", NULL);
	write_members(query, scene, "model", "optics");
	fclose(query);
	int status = http_send(client, &(struct http_request){.path = path}, &response);
	*optics = NULL;
	if (status == CLIENT_OK && response.status != 200) {
		problem_print(&response);
		status = CLIENT_REFUSED;
	} else if (status == CLIENT_OK) {
		*optics = json_loadb(response.body, response.size, 0, NULL);
		if (!optics_is_whole(*optics)) {
			client_error("%s answers no optics", client->server);
			status = CLIENT_REFUSED;
		}
	}
	http_response_finish(&response);
	free(path);
	return status;
}

static int show(const struct optics_options *options, const json_t *optics)
{
	if (options->json) {
		json_dumpf(optics, stdout, JSON_COMPACT | JSON_REAL_PRECISION(9));
		putchar('\n');
	} else if (options->plot) {
		optics_print_curve(stdout, optics);
	} else if (!options->output) {
		optics_print_table(stdout, optics);
	}
	if (client_end_output() != CLIENT_OK)
		return CLIENT_UNWRITABLE;
	return options->output ? optics_draw(optics, options->output) : CLIENT_OK;
}

static int run_optics(struct client *client, void *given, char **words)
{
	struct optics_options *options = given;
	json_t *scene = NULL, *optics = NULL;
	if (options->output && !plot_is_named(options->output)) {
		client_error("figures are .png or .svg, not %s", options->output);
		return CLIENT_USAGE;
	}
	if (!scene_source_take(&options->source, words[0]))
		return CLIENT_USAGE;
	int status = scene_source_load(client, &options->source, &scene);
	if (status == CLIENT_OK)
		status = fetch(client, scene, &optics);
	if (status == CLIENT_OK)
		status = show(options, optics);
	json_decref(optics);
	json_decref(scene);
	return status;
}

static const struct option_row rows[] = {
	FLAG_ROW("plot", 0, struct optics_options, plot, "draw the phase function in characters instead of the table"),
	TEXT_ROW("output", 'o', "FILE", WORDS_FILE, struct optics_options, output, "draw it into a .png or .svg (by gnuplot)"),
	FLAG_ROW("json", 0, struct optics_options, json, "print the daemon's answer, the whole phase function"),
	SCENE_SOURCE_ROWS(struct optics_options, source),
	{0},
};

const struct command command_optics = {
	.name = "optics",
	.arguments = "[SCENE.json|-]",
	.summary = "tell what droplets do to light",
	.remarks = "Extinction, albedo, asymmetry and phase function of a scene's droplets (dsd, and model.optics) at 650, 550 and 450 nm, "
		   "with\n"
		   "where fogbow and glory stand. --set dsd.effective_radius_um=12 changes them. What else is in the scene has no part in "
		   "it.\n",
	.options = rows,
	.size = sizeof(struct optics_options),
	.words_max = 1,
	.words = WORDS_FILE,
	.run = run_optics,
};
