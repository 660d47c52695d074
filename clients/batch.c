/* stratus batch: many scenes, a folder of pictures. */
#include "clients/batch_run.h"
#include "clients/commands.h"
#include "clients/scene_edit.h"
#include "clients/scene_source.h"

struct batch_options {
	struct scene_source source;
	struct batch_settings settings;
	struct text_list vary;
	int count; /* of scenes to be drawn; 0: they are read */
	double seed;
	const char *format;
};

static bool is_complete(const struct batch_options *options, const char *file)
{
	if (!options->settings.folder)
		client_error("batch wants -o FOLDER");
	else if ((options->count > 0) == (file != NULL))
		client_error("batch takes either a file of scenes or --count, which draws them");
	else if ((options->count > 0) != (options->vary.count > 0))
		client_error("--count and --vary go together: so many scenes, and what is drawn anew for each");
	else
		return true;
	return false;
}

static int make_list(const struct batch_options *options, const char *file, const json_t *base, struct scene_list *list)
{
	int status = file ? scene_list_read(file, base, list) : scene_list_draw(base, &options->vary, options->count, options->seed, list);
	/* --set and --format hold for lines as well. */
	for (int i = 0; status == CLIENT_OK && i < list->count; i++) {
		for (int s = 0; file && s < options->source.sets.count; s++)
			if (!scene_set(list->item[i].scene, options->source.sets.text[s]))
				return CLIENT_USAGE;
		if (options->format && !scene_set_format(list->item[i].scene, *options->format == 'e' ? ".exr" : ".png", false))
			return CLIENT_USAGE;
	}
	return status;
}

static int run_batch(struct client *client, void *given, char **words)
{
	struct batch_options *options = given;
	struct scene_list list = {0};
	json_t *base = NULL;
	if (!is_complete(options, words[0]))
		return CLIENT_USAGE;
	int status = scene_source_load(client, &options->source, &base);
	if (status == CLIENT_OK)
		status = make_list(options, words[0], base, &list);
	if (status == CLIENT_OK)
		status = batch_run(client, &options->settings, &list);
	scene_list_finish(&list);
	json_decref(base);
	return status;
}

static const struct option_row rows[] = {
	TEXT_ROW("output", 'o', "FOLDER", WORDS_FOLDER, struct batch_options, settings.folder,
		 "where pictures and manifest go; made if need be"),
	WHOLE_ROW("count", "N", 1, SCENE_LIST_MAX, struct batch_options, count, "draw so many scenes instead of reading them"),
	LIST_ROW("vary", "member=RANGE", WORDS_MEMBER, struct batch_options, vary,
		 "what is drawn anew for each: sun.elevation_deg=5.0..60.0 any number, clouds.seed=1..9 a whole one, "
		 "clouds.type=stratus,altocumulus "
		 "one of these; repeatable"),
	NUMBER_ROW("seed", "N", 0, 4294967295.0, struct batch_options, seed, "of what is drawn (1)"),
	SCENE_SOURCE_ROWS(struct batch_options, source),
	CHOICE_ROW("format", "FORMAT", "png exr", struct batch_options, format, "png or exr, where a scene does not say it"),
	POOL_ROWS(struct batch_options, settings.pool),
	TEXT_ROW("manifest", 0, "FILE", WORDS_FILE, struct batch_options, settings.manifest, "instead of manifest.jsonl in the folder"),
	FLAG_ROW("anew", 0, struct batch_options, settings.anew, "make also what the manifest says is made"),
	{0}};

static const struct batch_options defaults = {.settings = {.pool = POOL_DEFAULTS, .what = "pictures"}, .seed = 1};

const struct command command_batch = {
	.name = "batch",
	.arguments = "[SCENES.jsonl|-]",
	.summary = "render many scenes into a folder, with a manifest",
	.remarks = "A line of the file is a scene, or {\"name\": \"a\", \"scene\": {}, \"labels\": {}}; it is laid over --preset. Pictures "
		   "are called by\n"
		   "their names, or 000001 and so on. The manifest has a line for each: name, labels (what was drawn), scene, file, bytes, "
		   "seconds and\n"
		   "the daemon's stages, or the error. Called again it makes what is missing or whose scene is another.\n",
	.options = rows,
	.size = sizeof(struct batch_options),
	.defaults = &defaults,
	.words_max = 1,
	.words = WORDS_FILE,
	.run = run_batch,
};
