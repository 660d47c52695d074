/* stratus bench: a load on the daemon, and how it bears it. */
#include "clients/bench/report.h"
#include "clients/commands.h"
#include "clients/output_file.h"
#include "clients/scene_source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OPEN_CONNECTIONS = 1024, CLOSED_CONNECTIONS = 4, CONNECTIONS_MAX = 65536 };

struct bench_options {
	struct scene_source source;
	const char *mix, *path, *json;
	struct load_settings load;
};

static bool is_complete(const struct bench_options *options)
{
	const bool scene = options->source.file || options->source.preset || options->source.sets.count > 0;
	if (scene + (options->mix != NULL) + (options->path != NULL) > 1)
		client_error("bench takes a scene, --mix or --get, one of them");
	else if (options->path && (*options->path != '/' || strpbrk(options->path, " \r\n")))
		client_error("--get wants a path, such as /healthz");
	else if (options->load.random_arrivals && options->load.rate <= 0)
		client_error("--random is for an open load, by --rate: in a closed one each client asks when it was answered");
	else
		return true;
	return false;
}

static int make_mix(const struct client *client, const struct bench_options *options, struct mix **mix)
{
	if (options->mix)
		return mix_read(options->mix, mix);
	json_t *scene = NULL;
	int status = options->path ? CLIENT_OK : scene_source_load(client, &options->source, &scene);
	if (status == CLIENT_OK && !(*mix = options->path ? mix_of_path(options->path) : mix_of_scene(scene))) {
		client_error("out of memory");
		status = CLIENT_USAGE;
	}
	json_decref(scene);
	return status;
}

/* Figures as JSON into a file, or tables for people on standard output. */
static int tell(const struct client *client, const struct bench_options *options, const struct mix *mix, const struct load_result *result)
{
	if (!options->json || (!client->quiet && strcmp(options->json, "-") != 0))
		report_print(stdout, &options->load, mix, result);
	if (!options->json)
		return CLIENT_OK;
	json_t *report = report_json(&options->load, mix, result);
	char *text = report ? json_dumps(report, JSON_INDENT(2) | JSON_REAL_PRECISION(9)) : NULL;
	const bool written = text && output_file_write(options->json, text, strlen(text));
	if (!text)
		client_error("out of memory");
	free(text);
	json_decref(report);
	return written ? CLIENT_OK : CLIENT_UNWRITABLE;
}

static int run_bench(struct client *client, void *given, char **words)
{
	struct bench_options *options = given;
	struct load_result result = {0};
	struct mix *mix = NULL;
	if (!scene_source_take(&options->source, words[0]) || !is_complete(options))
		return CLIENT_USAGE;
	if (options->load.connections == 0)
		options->load.connections = options->load.rate > 0 ? OPEN_CONNECTIONS : CLOSED_CONNECTIONS;
	if (client->timeout_s > 0)
		options->load.timeout_s = client->timeout_s + 1; /* the daemon's answer that it was too late should still be heard */
	int status = make_mix(client, options, &mix);
	if (status == CLIENT_OK)
		status = load_run(client, mix, &options->load, &result);
	if (status == CLIENT_OK)
		status = tell(client, options, mix, &result);
	if (status == CLIENT_OK && histogram_count(result.good) == 0)
		status = CLIENT_REFUSED;
	load_result_finish(&result);
	mix_destroy(mix);
	return status;
}

static const struct option_row rows[] = {
	NUMBER_ROW("rate", "N", 0.01, 1e6, struct bench_options, load.rate, "requests per second; without it a closed load"),
	FLAG_ROW("random", 0, struct bench_options, load.random_arrivals,
		 "arrivals at random times (a Poisson process) instead of even ones"),
	WHOLE_ROW("connections", "N", 1, CONNECTIONS_MAX, struct bench_options, load.connections,
		  "clients of a closed load (4); most connections of an open one (1024)"),
	NUMBER_ROW("duration", "S", 0.1, 86400, struct bench_options, load.duration_s, "seconds that are measured (10)"),
	NUMBER_ROW("warm-up", "S", 0, 3600, struct bench_options, load.warm_up_s, "seconds of load before them (2)"),
	TEXT_ROW("mix", 0, "FILE", WORDS_FILE, struct bench_options, mix,
		 "kinds of requests, a JSON object a line: name, weight, scene, vary, or path"),
	TEXT_ROW("get", 0, "PATH", WORDS_ANY, struct bench_options, path, "fetch a path instead of a scene"),
	SCENE_SOURCE_ROWS(struct bench_options, source),
	NUMBER_ROW("seed", "N", 0, 4294967295.0, struct bench_options, load.seed, "of what is drawn at random (1)"),
	TEXT_ROW("json", 0, "FILE", WORDS_FILE, struct bench_options, json,
		 "the figures as JSON as well; - is standard output, instead of the tables"),
	{0}};

static const struct bench_options defaults = {.load = {.duration_s = 10, .warm_up_s = 2, .timeout_s = 60, .seed = 1}};

const struct command command_bench = {
	.name = "bench",
	.arguments = "[SCENE.json|-]",
	.summary = "put a load on the daemon and measure its answers",
	.remarks =
		"With --rate requests go out at fixed times, whatever the answers, and latencies count from those times: a daemon that\n"
		"stands still is charged with all who would have come meanwhile. Without it a number of clients each ask when they were\n"
		"answered.\n",
	.notes = "In a mix {\"scene\": {}, \"vary\": {\"sun.elevation_deg\": [5.0, 60.0]}} draws that member for every request.\n"
		 "A request is given up after --timeout and a second more, or 60 seconds.\n",
	.options = rows,
	.size = sizeof(struct bench_options),
	.defaults = &defaults,
	.words_max = 1,
	.words = WORDS_FILE,
	.run = run_bench,
};
