/* stratus info FILE: what an image says of itself; its scene, to render it again. Needs no daemon. */
#include "clients/commands.h"
#include "clients/image_info.h"

#include <stdio.h>
#include <string.h>

struct info_options {
	bool scene, json;
};

enum { NAME_WIDTH = 32 };

/* Files may hold anything; a terminal gets no control characters from them. */
static void print_plain(const char *text)
{
	for (; *text; text++)
		putchar((unsigned char)*text < 0x20 || *text == 0x7f ? ' ' : *text);
}

static void print_name(const char *name)
{
	print_plain(name);
	printf("%*s ", (int)(strlen(name) < NAME_WIDTH ? NAME_WIDTH - strlen(name) : 0), "");
}

static void print_value(const char *name, const json_t *value)
{
	size_t i;
	json_t *element;
	print_name(name);
	if (json_is_string(value))
		print_plain(json_string_value(value));
	else if (json_is_number(value))
		printf("%.7g", json_number_value(value));
	json_array_foreach(value, i, element) printf("%s%.6g", i ? " " : "", json_number_value(element));
	putchar('\n');
}

static void print_channels(const json_t *channels)
{
	size_t i;
	json_t *name;
	print_name("channels");
	if (json_is_integer(channels))
		printf("%lld", (long long)json_integer_value(channels));
	json_array_foreach(channels, i, name)
	{
		print_plain(i ? " " : "");
		print_plain(json_string_value(name));
	}
	putchar('\n');
}

static const char *scene_text(const json_t *info)
{
	return json_string_value(json_object_get(info, IMAGE_INFO_SCENE_TEXT));
}

static void print_json(json_t *info)
{
	json_object_del(info, IMAGE_INFO_SCENE_TEXT);
	json_dumpf(info, stdout, JSON_INDENT(2));
	putchar('\n');
}

static void print_text(json_t *info)
{
	const char *name;
	json_t *value;
	print_name("image");
	printf("%s, %lld x %lld\n", json_string_value(json_object_get(info, "format")),
	       (long long)json_integer_value(json_object_get(info, "width")),
	       (long long)json_integer_value(json_object_get(info, "height")));
	print_channels(json_object_get(info, "channels"));
	json_object_foreach(json_object_get(info, "attributes"), name, value) print_value(name, value);
	if (json_object_get(info, "scene")) {
		print_name("stratus:scene");
		print_plain(scene_text(info));
		putchar('\n');
	}
}

static int print(json_t *info, const struct info_options *options, const char *path)
{
	const json_t *scene = json_object_get(info, "scene");
	if (options->scene && !scene) {
		client_error("%s: holds no scene", path);
		return CLIENT_USAGE;
	}
	if (options->scene)
		puts(scene_text(info));
	else if (options->json)
		print_json(info);
	else
		print_text(info);
	return client_end_output();
}

static int run_info(struct client *client, void *options, char **words)
{
	(void)client;
	json_t *info = image_info_read(words[0]);
	const int status = info ? print(info, options, words[0]) : CLIENT_USAGE;
	json_decref(info);
	return status;
}

static const struct option_row rows[] = {
	FLAG_ROW("scene", 0, struct info_options, scene,
		 "print the scene in it, as JSON: stratus info --scene sky.exr | stratus render - -o again.exr"),
	FLAG_ROW("json", 0, struct info_options, json, "print everything as JSON"),
	{0},
};

const struct command command_info = {
	.name = "info",
	.arguments = "FILE",
	.summary = "tell what an image file says of itself",
	.remarks = "Reads the header alone, and asks no daemon.\n",
	.options = rows,
	.size = sizeof(struct info_options),
	.words_min = 1,
	.words_max = 1,
	.words = WORDS_FILE,
	.run = run_info,
};
