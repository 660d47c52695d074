/* stratus asset: uploads, lists, fetches and deletes the maps that scenes name. */
#include "clients/commands.h"
#include "clients/http.h"
#include "clients/output_file.h"
#include "clients/problem.h"

#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { NAME_LENGTH_MAX = 63, WORDS_MAX = 3 };

struct asset_options {
	const char *output; /* of get */
	bool only_new;      /* put: nothing is to be replaced */
	char **words;       /* what stands behind the action */
	int word_count;
};

/* The address of an asset, malloc'd; NULL after a message. */
static char *path_of(const char *name)
{
	static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.";
	const size_t length = strlen(name);
	char *path;
	if (length < 1 || length > NAME_LENGTH_MAX || name[0] == '.' || strspn(name, plain) != length) {
		client_error("\"%s\" is no name: 1 to %d letters, digits, '-', '_' and '.', the first no dot", name, NAME_LENGTH_MAX);
		return NULL;
	}
	if (asprintf(&path, "/v1/assets/%s", name) >= 0)
		return path;
	client_error("out of memory");
	return NULL;
}

/* Sends a request; anything but an answer between 200 and 299 is told and refused. http_response_finish in any case. */
static int ask(const struct client *client, const struct http_request *request, struct http_response *response)
{
	const int status = http_send(client, request, response);
	if (status != CLIENT_OK || response->status / 100 == 2)
		return status;
	problem_print(response);
	return CLIENT_REFUSED;
}

/* --- the actions ------------------------------------------------------------------------------------------------------------------ */

/* Standard input for "-". NULL after a message. *size: negative when it is not known before. */
static FILE *open_upload(const char *path, int64_t *size)
{
	struct stat status = {0};
	*size = -1;
	if (strcmp(path, "-") == 0)
		return stdin;
	FILE *file = fopen(path, "rb");
	if (file && fstat(fileno(file), &status) == 0 && S_ISDIR(status.st_mode)) {
		fclose(file);
		file = NULL;
		errno = EISDIR;
	}
	if (S_ISREG(status.st_mode))
		*size = status.st_size;
	if (!file)
		client_error("%s: %s", path, strerror(errno));
	return file;
}

static int put(const struct client *client, const struct asset_options *options)
{
	struct http_request request = {.header = options->only_new ? "If-None-Match: *" : NULL};
	struct http_response response = {0};
	char *path = path_of(options->words[0]);
	int status = CLIENT_USAGE;
	request.path = path;
	request.upload = path ? open_upload(options->words[1], &request.size) : NULL;
	if (request.upload)
		status = ask(client, &request, &response);
	if (status == CLIENT_OK && !client->quiet)
		fprintf(stderr, "%s %s\n", options->words[0], response.status == 201 ? "uploaded" : "replaced");
	http_response_finish(&response);
	if (request.upload && request.upload != stdin)
		fclose(request.upload);
	free(path);
	return status;
}

static int get(const struct client *client, const struct asset_options *options)
{
	struct http_response response = {0};
	char *path = path_of(options->words[0]);
	int status = path ? ask(client, &(struct http_request){.path = path}, &response) : CLIENT_USAGE;
	if (status == CLIENT_OK && !output_file_write(options->output, response.body, response.size))
		status = CLIENT_UNWRITABLE;
	http_response_finish(&response);
	free(path);
	return status;
}

static int delete (const struct client *client, const struct asset_options *options)
{
	struct http_response response = {0};
	char *path = path_of(options->words[0]);
	const int status = path ? ask(client, &(struct http_request){.path = path, .remove = true}, &response) : CLIENT_USAGE;
	http_response_finish(&response);
	free(path);
	return status;
}

static int print_list(const struct client *client, const json_t *assets)
{
	size_t i;
	json_t *asset;
	json_array_foreach(assets, i, asset)
	{
		const char *name = "", *type = "";
		json_int_t width = 0, height = 0, bytes = 0;
		json_unpack(asset, "{s:s, s:s, s:I, s:I, s:I}", "name", &name, "content_type", &type, "width", &width, "height", &height,
			    "bytes", &bytes);
		if (client->quiet)
			puts(name);
		else
			printf("%-24s %-12s %5lld x %-5lld %lld\n", name, type, (long long)width, (long long)height, (long long)bytes);
	}
	return client_end_output();
}

static int list(const struct client *client, const struct asset_options *options)
{
	struct http_response response = {0};
	(void)options;
	int status = ask(client, &(struct http_request){.path = "/v1/assets"}, &response);
	if (status == CLIENT_OK) {
		json_t *answer = json_loadb(response.body, response.size, 0, NULL);
		const json_t *assets = json_object_get(answer, "assets");
		if (!json_is_array(assets))
			client_error("%s lists no assets", client->server);
		status = json_is_array(assets) ? print_list(client, assets) : CLIENT_REFUSED;
		json_decref(answer);
	}
	http_response_finish(&response);
	return status;
}

/* --- the command line --------------------------------------------------------------------------------------------------------------- */

static const struct action {
	const char *name;
	int words; /* behind it */
	bool has_output, has_new;
	int (*run)(const struct client *client, const struct asset_options *options);
} actions[] = {
	{"put", 2, false, true, put}, {"list", 0, false, false, list}, {"get", 1, true, false, get}, {"delete", 1, false, false, delete}};

static const struct action *find_action(const char *name)
{
	for (size_t i = 0; name && i < sizeof actions / sizeof *actions; i++)
		if (strcmp(actions[i].name, name) == 0)
			return &actions[i];
	return NULL;
}

static bool is_complete(const struct action *action, const struct asset_options *options)
{
	if (!action)
		client_error("asset wants one of put, list, get, delete");
	else if (options->word_count != action->words)
		client_error("asset %s takes %d argument%s", action->name, action->words, action->words == 1 ? "" : "s");
	else if (action->has_output != (options->output != NULL))
		client_error(action->has_output ? "asset %s wants -o FILE" : "asset %s takes no -o", action->name);
	else if (options->only_new && !action->has_new)
		client_error("asset %s takes no --new", action->name);
	else if (options->output && strcmp(options->output, "-") == 0 && isatty(STDOUT_FILENO))
		client_error("an image is no text for a terminal; redirect standard output or name a file");
	else
		return true;
	return false;
}

static int run_asset(struct client *client, void *given, char **words)
{
	struct asset_options *options = given;
	const struct action *action = find_action(words[0]);
	options->words = words + (words[0] != NULL);
	while (options->words[options->word_count])
		options->word_count++;
	return is_complete(action, options) ? action->run(client, options) : CLIENT_USAGE;
}

static const struct option_row rows[] = {
	FLAG_ROW("new", 0, struct asset_options, only_new, "put: only when there is none of this name"),
	TEXT_ROW("output", 'o', "FILE", WORDS_FILE, struct asset_options, output, "get: where to"),
	{0},
};

const struct command command_asset = {
	.name = "asset",
	.arguments = "put NAME FILE | list | get NAME -o FILE | delete NAME",
	.summary = "upload, list, fetch and delete maps for clouds and ground",
	.remarks = "A scene names a map as clouds.map (thickness, 0 to 1 of thickness_m) or ground.map (reflectance).\n"
		   "FILE is a PNG or an EXR, - standard input or output. With -q the list has names alone.\n",
	.options = rows,
	.size = sizeof(struct asset_options),
	.words_max = WORDS_MAX,
	.words = WORDS_FILE,
	.choices = "put list get delete",
	.run = run_asset,
};
