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

struct compare_options {
	struct scene_source source;
	const char *output; /* NULL: the table alone */
	json_t *variants;   /* the scene as it is, and those of --with; NULL until there is one */
	const char *against;
	struct text_list regions; /* empty: the daemon's */
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

/* The variants, of which the scene as it is is the first. NULL: out of memory. */
static json_t *variants_of(struct compare_options *options)
{
	if (!options->variants)
		options->variants = json_pack("[{}]");
	return options->variants;
}

/* The variant that the options before speak of. */
static json_t *last_variant(struct compare_options *options)
{
	json_t *variants = variants_of(options);
	return json_array_get(variants, json_array_size(variants) - 1);
}

static bool take_with(void *options, const char *value)
{
	json_array_append_new(variants_of(options), json_object());
	return scene_set(last_variant(options), value);
}

static bool take_and(void *options, const char *value)
{
	if (json_array_size(variants_of(options)) > 1)
		return scene_set(last_variant(options), value);
	client_error("--and adds to a --with, and there is none before it");
	return false;
}

static bool take_name(void *options, const char *value)
{
	if (json_object_set_new(last_variant(options), "name", json_string(value)) == 0)
		return true;
	client_error("--named wants a name in UTF-8");
	return false;
}

static void finish_options(void *given)
{
	struct compare_options *options = given;
	json_decref(options->variants);
}

static const struct option_row rows[] = {
	TAKE_ROW("with", "member=value", WORDS_MEMBER, take_with, "a variant: model.shading=paper, radiosity.enabled=false; up to three"),
	TAKE_ROW("and", "member=value", WORDS_MEMBER, take_and, "changes the variant further; repeatable"),
	TAKE_ROW("named", "NAME", WORDS_ANY, take_name,
		 "names the variant before it, or the scene as it is; else the table says how the daemon calls it: paper, or by what it "
		 "changes, radiosity-enabled-false"),
	TEXT_ROW("against", 0, "NAME", WORDS_ANY, struct compare_options, against, "the one that the others are compared with"),
	LIST_ROW("region", "NAME", WORDS_ANY, struct compare_options, regions,
		 "all, cloud, sky or ground; repeatable; all four unless given"),
	TEXT_ROW("output", 'o', "FILE", WORDS_FILE, struct compare_options, output,
		 ".json figures, .png pictures and maps of their differences, .exr the same to work with; - is figures on standard output"),
	SCENE_SOURCE_ROWS(struct compare_options, source),
	{0}};

/* --- asking ------------------------------------------------------------------------------------------------------------------------- */

/* The request's body, malloc'd into *body. */
static int compose_body(const struct client *client, struct compare_options *options, char **body)
{
	json_t *scene, *root;
	if (!last_variant(options)) {
		client_error("out of memory");
		return CLIENT_USAGE;
	}
	int status = scene_source_load(client, &options->source, &scene);
	if (status != CLIENT_OK)
		return status;
	if (json_array_size(options->variants) == 1)
		json_array_append_new(options->variants, json_pack("{s:{s:s}}", "model", "name", "reference"));
	root = json_pack("{s:o, s:O}", "scene", scene, "variants", options->variants);
	json_t *regions = options->regions.count ? json_array() : NULL;
	for (int i = 0; i < options->regions.count; i++)
		json_array_append_new(regions, json_string(options->regions.text[i]));
	if (options->against)
		json_object_set_new(root, "reference", json_string(options->against));
	if (regions)
		json_object_set_new(root, "regions", regions);
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
	return !printed ? CLIENT_REFUSED : client_end_output();
}

static void print_timings(const struct client *client, const struct http_response *response)
{
	struct timing_table table;
	if (client->quiet)
		return;
	timing_parse(response->server_timing, &table);
	timing_print(stderr, &table, response->seconds * 1000, response->size);
}

static int run_compare(struct client *client, void *given, char **words)
{
	struct compare_options *options = given;
	const struct form *form = form_of(options->output);
	struct http_response response = {0};
	char *body = NULL;
	if (!form)
		client_error("compare writes .json, .png or .exr, not %s", options->output);
	if (!form || !scene_source_take(&options->source, words[0]))
		return CLIENT_USAGE;
	int status = compose_body(client, options, &body);
	if (status == CLIENT_OK)
		status = http_send(client,
				   &(struct http_request){.path = "/v1/compare", .json = body, .accept = form->accept, .shows_time = true},
				   &response);
	if (status == CLIENT_OK)
		status = save_answer(client, options, &response);
	if (status == CLIENT_OK)
		print_timings(client, &response);
	http_response_finish(&response);
	free(body);
	return status;
}

const struct command command_compare = {
	.name = "compare",
	.arguments = "[SCENE.json|-]",
	.summary = "hold a scene against variants of itself",
	.remarks = "The scene as it is and each --with are rendered and compared: with the model reference where one is, else with the "
		   "scene.\n"
		   "Without --with the scene is compared with its reference. The table gives percents of the reference's mean light: bias "
		   "and\n"
		   "its standard error, root mean square difference, what of that is noise and what is left without it; and FLIP, what an\n"
		   "observer notices (0 to 1). Timings go to standard error.\n",
	.options = rows,
	.size = sizeof(struct compare_options),
	.words_max = 1,
	.words = WORDS_FILE,
	.run = run_compare,
	.finish = finish_options,
};
