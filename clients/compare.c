/* stratus compare: a scene beside variants of itself, in figures and pictures. */
#include "clients/commands.h"
#include "clients/compare_table.h"
#include "clients/http.h"
#include "clients/image_info.h"
#include "clients/output_file.h"
#include "clients/problem.h"
#include "clients/scene_edit.h"
#include "clients/scene_source.h"
#include "clients/timing.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

enum { PRESET = 'p', SET = 's', WITH = 'w', AND = 'a', NAMED = 'n', AGAINST = 'r', REGION = 'g' };

struct compare_options {
	struct scene_source source;
	const char *output; /* NULL: the table alone */
	json_t *variants;   /* the scene as it is, and those of --with */
	const char *against;
	json_t *regions; /* empty: the daemon's */
};

static const struct form {
	const char *extension, *accept, *type;
} forms[] = {{".json", "Accept: application/json", "application/json"},
	     {".png", "Accept: image/png", "image/png"},
	     {".exr", "Accept: image/x-exr", "image/x-exr"}};

/* NULL: an extension that says none of them. */
static const struct form *form_of(const char *output)
{
	const char *dot = output ? strrchr(output, '.') : NULL;
	if (!output || strcmp(output, "-") == 0)
		return &forms[0];
	for (size_t i = 0; dot && i < sizeof forms / sizeof *forms; i++)
		if (strcasecmp(dot, forms[i].extension) == 0)
			return &forms[i];
	return NULL;
}

/* --- the command line ------------------------------------------------------------------------------------------------------------- */

/* The variant that the options before speak of. */
static json_t *last_variant(const struct compare_options *options)
{
	return json_array_get(options->variants, json_array_size(options->variants) - 1);
}

/* false after a message */
static bool take_option(struct compare_options *options, int option, const char *value)
{
	switch (option) {
	case PRESET:
		options->source.preset = value;
		return true;
	case SET:
		options->source.sets[options->source.set_count++] = value;
		return true;
	case WITH:
		json_array_append_new(options->variants, json_object());
		return scene_set(last_variant(options), value);
	case AND:
		if (json_array_size(options->variants) > 1)
			return scene_set(last_variant(options), value);
		client_error("--and adds to a --with, and there is none before it");
		return false;
	case NAMED:
		return json_object_set_new(last_variant(options), "name", json_string(value)) == 0;
	case AGAINST:
		options->against = value;
		return true;
	case REGION:
		return json_array_append_new(options->regions, json_string(value)) == 0;
	default:
		options->output = value;
		return true;
	}
}

static bool is_complete(const struct compare_options *options, int words)
{
	if (words > 1 || (options->source.file && options->source.preset))
		client_error("compare takes one scene: a file, - or a preset");
	else if (!form_of(options->output))
		client_error("compare writes .json, .png or .exr, not %s", options->output);
	else
		return true;
	return false;
}

/* Negative: go on; else the exit status. */
static int read_options(struct client *client, struct compare_options *options, int argc, char **argv)
{
	static const struct option table[] = {{"preset", required_argument, NULL, PRESET},
					      {"set", required_argument, NULL, SET},
					      {"with", required_argument, NULL, WITH},
					      {"and", required_argument, NULL, AND},
					      {"named", required_argument, NULL, NAMED},
					      {"against", required_argument, NULL, AGAINST},
					      {"region", required_argument, NULL, REGION},
					      {"output", required_argument, NULL, 'o'},
					      CLIENT_LONG_OPTIONS,
					      {0}};
	static const int own[] = {PRESET, SET, WITH, AND, NAMED, AGAINST, REGION, 'o'};
	for (int option; (option = getopt_long(argc, argv, "o:" CLIENT_SHORT_OPTIONS, table, NULL)) != -1;) {
		bool is_own = false;
		for (size_t i = 0; i < sizeof own / sizeof *own; i++)
			is_own |= own[i] == option;
		const int end = is_own ? (take_option(options, option, optarg) ? -1 : CLIENT_USAGE) : client_option(client, option);
		if (end >= 0)
			return end;
	}
	options->source.file = argv[optind];
	return is_complete(options, argc - optind) ? -1 : CLIENT_USAGE;
}

/* --- asking ------------------------------------------------------------------------------------------------------------------------- */

/* The request's body, malloc'd into *body. */
static int compose_body(const struct client *client, const struct compare_options *options, char **body)
{
	json_t *scene, *root;
	int status = scene_source_load(client, &options->source, &scene);
	if (status != CLIENT_OK)
		return status;
	if (json_array_size(options->variants) == 1)
		json_array_append_new(options->variants, json_pack("{s:{s:s}}", "model", "name", "reference"));
	root = json_pack("{s:o, s:O}", "scene", scene, "variants", options->variants);
	if (options->against)
		json_object_set_new(root, "reference", json_string(options->against));
	if (json_array_size(options->regions) > 0)
		json_object_set(root, "regions", options->regions);
	*body = root ? json_dumps(root, JSON_COMPACT) : NULL;
	json_decref(root);
	if (!*body)
		client_error("the command line is no UTF-8, or there is no memory");
	return *body ? CLIENT_OK : CLIENT_USAGE;
}

/* The figures, of whatever form the answer has; NULL when it holds none. */
static json_t *read_figures(const struct compare_options *options, const struct form *form, const struct http_response *response)
{
	if (form == &forms[0])
		return json_loadb(response->body, response->size, 0, NULL);
	json_t *info = image_info_read(options->output);
	const char *text = json_string_value(json_object_get(json_object_get(info, "attributes"), "stratus:comparison"));
	json_t *figures = text ? json_loads(text, 0, NULL) : NULL;
	json_decref(info);
	return figures;
}

static int save_answer(const struct client *client, const struct compare_options *options, const struct http_response *response)
{
	const struct form *form = form_of(options->output);
	const bool to_terminal = !options->output || strcmp(options->output, "-") != 0;
	if (response->status != 200) {
		problem_print(response);
		return CLIENT_REFUSED;
	}
	if (strcmp(response->content_type, form->type) != 0) {
		client_error("the server answers %s instead of %s", *response->content_type ? response->content_type : "nothing",
			     form->type);
		return CLIENT_REFUSED;
	}
	if (options->output && !output_file_write(options->output, response->body, response->size))
		return CLIENT_UNWRITABLE;
	if (client->quiet && options->output)
		return CLIENT_OK;
	json_t *figures = read_figures(options, form, response);
	const bool printed = compare_table_print(to_terminal ? stdout : stderr, figures);
	json_decref(figures);
	if (!printed)
		client_error("the server answers no comparison");
	return !printed ? CLIENT_REFUSED : fflush(stdout) == 0 ? CLIENT_OK : CLIENT_UNWRITABLE;
}

static void print_timings(const struct client *client, const struct http_response *response)
{
	struct timing_table table;
	if (client->quiet)
		return;
	timing_parse(response->server_timing, &table);
	timing_print(stderr, &table, response->seconds * 1000, response->size);
}

static int run_compare(struct client *client, int argc, char **argv)
{
	const char **sets = calloc((size_t)argc, sizeof *sets);
	struct compare_options options = {.source.sets = sets, .variants = json_pack("[{}]"), .regions = json_array()};
	struct http_response response = {0};
	char *body = NULL;
	int status = sets && options.variants && options.regions ? read_options(client, &options, argc, argv) : CLIENT_USAGE;
	if (status < 0)
		status = compose_body(client, &options, &body);
	if (status == CLIENT_OK && body)
		status = http_send(client,
				   &(struct http_request){.path = "/v1/compare", .json = body, .accept = form_of(options.output)->accept},
				   &response);
	if (status == CLIENT_OK && body)
		status = save_answer(client, &options, &response);
	if (status == CLIENT_OK && body)
		print_timings(client, &response);
	http_response_finish(&response);
	free(body);
	json_decref(options.variants);
	json_decref(options.regions);
	free(sets);
	return status;
}

const struct command command_compare = {
	.name = "compare",
	.arguments = "[SCENE.json|-]",
	.summary = "hold a scene against variants of itself",
	.help = "The scene as it is and each --with are rendered and compared: with the model reference where one is, else with the "
		"scene.\n"
		"Without --with the scene is compared with its reference. The table gives percents of the reference's mean light:\n"
		"bias and its standard error, root mean square difference, what of that is noise and what is left without it; and FLIP, "
		"what an\n"
		"observer notices (0 to 1). Timings go to standard error.\n\n"
		"  --with member=value   a variant: model.shading=paper, radiosity.enabled=false; up to three\n"
		"  --and member=value    changes the variant further; repeatable\n"
		"  --named NAME          names the variant before it, or the scene as it is; else the table says how the daemon calls it:\n"
		"                        paper, or by what it changes, radiosity-enabled-false\n"
		"  --against NAME        the one that the others are compared with\n"
		"  --region NAME         all, cloud, sky or ground; repeatable; all four unless given\n"
		"  -o, --output FILE     .json figures, .png pictures and maps of their differences, .exr the same to work with; - is "
		"figures on\n"
		"                        standard output\n"
		"  --preset NAME         start from one of the daemon's scenes\n"
		"  --set member=value    change the scene, for all variants; repeatable\n",
	.run = run_compare,
};
