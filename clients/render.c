/* stratus render: one scene in, one image file out. */
#include "clients/commands.h"
#include "clients/file_type.h"
#include "clients/http.h"
#include "clients/output_file.h"
#include "clients/problem.h"
#include "clients/scene_edit.h"
#include "clients/scene_source.h"
#include "clients/timing.h"
#include "clients/watch.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

struct render_options {
	struct scene_source source;
	const char *output;
	bool watch;
};

static bool is_complete(const struct render_options *options)
{
	if (!options->output)
		client_error("render wants -o FILE, or -o - for standard output");
	else if (strcmp(options->output, "-") == 0 && isatty(STDOUT_FILENO))
		client_error("an image is no text for a terminal; redirect standard output or name a file");
	else if (file_type_is_picture(options->output) && !scene_format_of(options->output))
		client_error("%s: render writes .png and .exr; what else there is, other programs make of them", options->output);
	else if (options->watch && (!options->source.file || strcmp(options->source.file, "-") == 0 || strcmp(options->output, "-") == 0))
		client_error("--watch wants a scene in a file, and a file for the image");
	else
		return true;
	return false;
}

/* The request's body, malloc'd into *body. */
static int compose_scene(const struct client *client, const struct render_options *options, char **body)
{
	json_t *scene;
	int status = scene_source_load(client, &options->source, &scene);
	if (status == CLIENT_OK && !(scene_set_format(scene, options->output, true) && (*body = json_dumps(scene, JSON_COMPACT)))) {
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

static int render(const struct client *client, const struct render_options *options)
{
	struct http_response response = {0};
	char *body = NULL;
	int status = compose_scene(client, options, &body);
	if (status == CLIENT_OK)
		status = http_send(client, &(struct http_request){.path = "/v1/render", .json = body, .shows_time = true}, &response);
	if (status == CLIENT_OK)
		status = save_answer(client, options->output, &response);
	http_response_finish(&response);
	free(body);
	return status;
}

/* Goes on until it is interrupted: a scene that is wrong now may be right when it is saved again. */
__attribute__((noreturn)) static void render_again_and_again(const struct client *client, const struct render_options *options)
{
	struct watch watch;
	for (;;) {
		watch_begin(&watch, options->source.file);
		render(client, options);
		if (!client->quiet)
			fprintf(stderr, "waiting for %s to change\n", options->source.file);
		watch_await(&watch);
	}
}

static int run_render(struct client *client, void *given, char **words)
{
	struct render_options *options = given;
	if (!scene_source_take(&options->source, words[0]) || !is_complete(options))
		return CLIENT_USAGE;
	if (options->watch)
		render_again_and_again(client, options);
	return render(client, options);
}

static const struct option_row rows[] = {
	TEXT_ROW("output", 'o', "FILE", WORDS_FILE, struct render_options, output,
		 "the image; .png or .exr is its format, whatever the scene says; - is standard output, in the scene's"),
	FLAG_ROW("watch", 0, struct render_options, watch, "render again whenever the scene's file is saved, until interrupted"),
	SCENE_SOURCE_ROWS(struct render_options, source),
	{0}};

const struct command command_render = {
	.name = "render",
	.arguments = "[SCENE.json|-]",
	.summary = "render a scene into a PNG or EXR file",
	.remarks = "Without a scene the daemon's default sky is rendered. Timings go to standard error.\n",
	.options = rows,
	.size = sizeof(struct render_options),
	.words_max = 1,
	.words = WORDS_FILE,
	.run = run_render,
};
