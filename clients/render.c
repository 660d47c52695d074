/* stratus render: one scene in, one image file out. */
#include "clients/commands.h"
#include "clients/http.h"
#include "clients/output_file.h"
#include "clients/problem.h"
#include "clients/scene_edit.h"
#include "clients/scene_source.h"
#include "clients/timing.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

struct render_options {
	struct scene_source source;
	const char *output;
};

enum { PRESET = 'p', SET = 's' };

/* Negative: go on; else the exit status. options->source.sets has room for argc texts. */
static int read_options(struct client *client, struct render_options *options, int argc, char **argv)
{
	static const struct option table[] = {{"preset", required_argument, NULL, PRESET},
					      {"set", required_argument, NULL, SET},
					      {"output", required_argument, NULL, 'o'},
					      CLIENT_LONG_OPTIONS,
					      {0}};
	for (int option; (option = getopt_long(argc, argv, "o:" CLIENT_SHORT_OPTIONS, table, NULL)) != -1;) {
		if (option == PRESET) {
			options->source.preset = optarg;
		} else if (option == SET) {
			options->source.sets[options->source.set_count++] = optarg;
		} else if (option == 'o') {
			options->output = optarg;
		} else {
			const int end = client_option(client, option);
			if (end >= 0)
				return end;
		}
	}
	options->source.file = argv[optind];
	if (argc - optind > 1 || (options->source.file && options->source.preset))
		client_error("render takes one scene: a file, - or a preset");
	else if (!options->output)
		client_error("render wants -o FILE, or -o - for standard output");
	else if (strcmp(options->output, "-") == 0 && isatty(STDOUT_FILENO))
		client_error("an image is no text for a terminal; redirect standard output or name a file");
	else
		return -1;
	return CLIENT_USAGE;
}

/* The request's body, malloc'd into *body. */
static int compose_scene(const struct client *client, const struct render_options *options, char **body)
{
	json_t *scene;
	int status = scene_source_load(client, &options->source, &scene);
	if (status == CLIENT_OK && !(scene_set_format(scene, options->output) && (*body = json_dumps(scene, JSON_COMPACT)))) {
		client_error("out of memory");
		status = CLIENT_USAGE;
	}
	json_decref(scene);
	return status;
}

static int save_answer(const struct client *client, const char *output, const struct http_response *response)
{
	if (response->status != 200) {
		problem_print(response);
		return CLIENT_REFUSED;
	}
	if (strncmp(response->content_type, "image/", 6) != 0) {
		client_error("the server answers %s instead of an image", *response->content_type ? response->content_type : "nothing");
		return CLIENT_REFUSED;
	}
	if (!output_file_write(output, response->body, response->size))
		return CLIENT_UNWRITABLE;
	if (!client->quiet) {
		struct timing_table table;
		timing_parse(response->server_timing, &table);
		timing_print(stderr, &table, response->seconds * 1000, response->size);
	}
	return CLIENT_OK;
}

static int run_render(struct client *client, int argc, char **argv)
{
	const char **sets = calloc((size_t)argc, sizeof *sets);
	struct render_options options = {.source.sets = sets};
	struct http_response response = {0};
	char *body = NULL;
	int status = CLIENT_USAGE;
	if (!sets)
		goto cleanup;
	status = read_options(client, &options, argc, argv);
	if (status >= 0)
		goto cleanup;
	status = compose_scene(client, &options, &body);
	if (status == CLIENT_OK)
		status = http_send(client, &(struct http_request){.path = "/v1/render", .json = body}, &response);
	if (status == CLIENT_OK)
		status = save_answer(client, options.output, &response);
cleanup:
	http_response_finish(&response);
	free(body);
	free(sets);
	return status;
}

const struct command command_render = {
	.name = "render",
	.arguments = "[SCENE.json|-]",
	.summary = "render a scene into a PNG or EXR file",
	.help = "Without a scene the daemon's default sky is rendered. Timings go to standard error.\n\n"
		"  -o, --output FILE  the image; .png or .exr chooses the format unless the scene does; - is standard output\n"
		"  --preset NAME      start from one of the daemon's scenes\n"
		"  --set member=value change the scene: sun.elevation_deg=10, camera.position_m=[0,0,3000]; repeatable\n",
	.run = run_render,
};
