/* stratus bench: a load on the daemon, and how it bears it. */
#include "clients/bench/report.h"
#include "clients/bench/run_compare.h"
#include "clients/bench/sweep.h"
#include "clients/commands.h"
#include "clients/member_range.h"
#include "clients/output_file.h"
#include "clients/plot.h"
#include "clients/scene_source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OPEN_CONNECTIONS = 1024, CLOSED_CONNECTIONS = 4, CONNECTIONS_MAX = 65536 };

struct bench_options {
	struct scene_source source;
	const char *mix, *path, *json;
	const char *plot; /* of a sweep */
	const char *old;  /* a run that another is compared with */
	struct text_list vary;
	bool sweep;
	double p99_ms;
	struct load_settings load;
};

static bool is_complete(const struct bench_options *options)
{
	const bool scene = options->source.file || options->source.preset || options->source.sets.count > 0;
	if (scene + (options->mix != NULL) + (options->path != NULL) > 1)
		client_error("bench takes a scene, --mix or --get, one of them");
	else if (options->path && (*options->path != '/' || strpbrk(options->path, " \r\n")))
		client_error("--get wants a path, such as /healthz");
	else if (options->vary.count > 0 && (options->mix || options->path))
		client_error("--vary is for a scene; the lines of a mix have their own");
	else if ((options->plot || options->p99_ms > 0) && !options->sweep)
		client_error("--plot and --within-ms belong to --sweep");
	else if (options->plot && !plot_is_named(options->plot))
		client_error("figures are .png or .svg, not %s", options->plot);
	else if (options->load.random_arrivals && options->load.rate <= 0 && !options->sweep)
		client_error("--random is for an open load, by --rate: in a closed one each client asks when it was answered");
	else
		return true;
	return false;
}

/* "member=low..high" as a line of a mix has it. NULL after a message. */
static json_t *read_vary(const struct text_list *texts)
{
	json_t *vary = json_object();
	for (int i = 0; i < texts->count; i++) {
		struct member_range range;
		if (!member_range_read(texts->text[i], &range) || range.from > range.to) {
			client_error("--vary wants member=low..high, not \"%s\"", texts->text[i]);
			json_decref(vary);
			return NULL;
		}
		json_t *bounds = range.whole ? json_pack("[I, I]", (json_int_t)range.from, (json_int_t)range.to)
					     : json_pack("[f, f]", range.from, range.to);
		json_object_set_new(vary, range.member, bounds);
	}
	return vary;
}

static int make_scene_mix(const struct client *client, const struct bench_options *options, struct mix **mix)
{
	json_t *scene = NULL, *vary = read_vary(&options->vary);
	int status = vary ? scene_source_load(client, &options->source, &scene) : CLIENT_USAGE;
	if (status == CLIENT_OK && !(*mix = mix_of_scene(scene, vary))) {
		client_error("a member that is varied is none that the scene can have");
		status = CLIENT_USAGE;
	}
	json_decref(scene);
	json_decref(vary);
	return status;
}

static int make_mix(const struct client *client, const struct bench_options *options, struct mix **mix)
{
	if (options->mix)
		return mix_read(options->mix, mix);
	if (!options->path)
		return make_scene_mix(client, options, mix);
	*mix = mix_of_path(options->path);
	if (!*mix)
		client_error("out of memory");
	return *mix ? CLIENT_OK : CLIENT_USAGE;
}

/* Takes the reference of an object, NULL too. */
static int write_json(const char *path, json_t *object)
{
	char *text = object ? json_dumps(object, JSON_INDENT(2) | JSON_REAL_PRECISION(9)) : NULL;
	const bool written = text && output_file_write(path, text, strlen(text));
	if (!text)
		client_error("out of memory");
	free(text);
	json_decref(object);
	return written ? CLIENT_OK : CLIENT_UNWRITABLE;
}

/* What would be lost at the end is told before the load. */
static bool has_place_for_results(const struct bench_options *options)
{
	return (!options->json || output_file_check(options->json)) && (!options->plot || plot_check(options->plot));
}

/* The first that went wrong is the status; what can be written is written all the same. */
static int worse(int status, int other)
{
	return status == CLIENT_OK || status == CLIENT_INTERRUPTED ? (other == CLIENT_OK ? status : other) : status;
}

/* Are tables wanted on standard output? */
static bool is_for_people(const struct client *client, const struct bench_options *options)
{
	return !options->json || (!client->quiet && strcmp(options->json, "-") != 0);
}

static int run_once(const struct client *client, const struct bench_options *options, struct mix *mix)
{
	struct load_result result = {0};
	int status = load_run(client, mix, &options->load, &result);
	const bool measured = status == CLIENT_OK || status == CLIENT_INTERRUPTED;
	if (status == CLIENT_INTERRUPTED)
		client_error("interrupted after %.3g s that were measured; %llu requests had no answer yet and are not counted",
			     result.seconds, (unsigned long long)result.unanswered);
	if (measured && is_for_people(client, options)) {
		report_print(stdout, &options->load, mix, &result);
		status = worse(status, client_end_output());
	}
	if (measured && options->json)
		status = worse(status, write_json(options->json, report_json(&options->load, mix, &result)));
	if (status == CLIENT_OK && histogram_count(result.good) == 0)
		status = CLIENT_REFUSED;
	load_result_finish(&result);
	return status;
}

static int run_sweep(const struct client *client, const struct bench_options *options, struct mix *mix)
{
	const struct sweep_settings settings = {.load = options->load, .p99_ms = options->p99_ms};
	struct sweep sweep;
	int status = sweep_run(client, mix, &settings, &sweep);
	const bool measured = status == CLIENT_OK || (status == CLIENT_INTERRUPTED && sweep.steps > 0);
	if (status == CLIENT_INTERRUPTED)
		client_error("interrupted: the sweep has %d whole steps and did not come to its end", sweep.steps);
	if (measured && is_for_people(client, options)) {
		sweep_print(stdout, &sweep);
		status = worse(status, client_end_output());
	}
	if (measured && options->json)
		status = worse(status, write_json(options->json, sweep_json(&sweep)));
	if (measured && options->plot)
		status = worse(status, sweep_draw(&sweep, options->plot));
	sweep_finish(&sweep);
	return status;
}

static int run_bench(struct client *client, void *given, char **words)
{
	struct bench_options *options = given;
	struct mix *mix = NULL;
	if (options->old && !words[0])
		client_error("--compare OLD.json wants the new run behind it: NEW.json");
	if (options->old)
		return words[0] ? run_compare(options->old, words[0], options->json && strcmp(options->json, "-") == 0) : CLIENT_USAGE;
	if (!scene_source_take(&options->source, words[0]) || !is_complete(options))
		return CLIENT_USAGE;
	if (!has_place_for_results(options))
		return CLIENT_UNWRITABLE;
	if (options->load.connections == 0)
		options->load.connections = options->load.rate > 0 || options->sweep ? OPEN_CONNECTIONS : CLOSED_CONNECTIONS;
	if (client->timeout_s > 0)
		options->load.timeout_s = client->timeout_s + 1; /* the daemon's answer that it was too late should still be heard */
	int status = make_mix(client, options, &mix);
	load_catch_interrupts();
	if (status == CLIENT_OK)
		status = options->sweep ? run_sweep(client, options, mix) : run_once(client, options, mix);
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
	LIST_ROW("vary", "member=LOW..HIGH", WORDS_MEMBER, struct bench_options, vary,
		 "draw a member of the scene for every request: camera.azimuth_deg=0.0..359.0; the same scene again is the daemon's memory "
		 "alone"),
	SCENE_SOURCE_ROWS(struct bench_options, source),
	NUMBER_ROW("seed", "N", 0, 4294967295.0, struct bench_options, load.seed, "of what is drawn at random (1)"),
	FLAG_ROW("sweep", 0, struct bench_options, sweep,
		 "loads at rising rates, from --rate or a quarter of what four clients get, up to the knee: the last that is borne"),
	NUMBER_ROW("within-ms", "MS", 0.001, 1e6, struct bench_options, p99_ms,
		   "of a sweep: a 99th percentile that is longer is not borne"),
	TEXT_ROW("plot", 0, "FILE", WORDS_FILE, struct bench_options, plot,
		 "of a sweep: latencies and answers over the rate as .png or .svg"),
	TEXT_ROW("compare", 0, "OLD.json", WORDS_FILE, struct bench_options, old,
		 "no load: holds a run, NEW.json, against another, with intervals; --json - prints JSON"),
	TEXT_ROW("json", 0, "FILE", WORDS_FILE, struct bench_options, json,
		 "the figures as JSON as well; - is standard output, instead of the tables"),
	{0}};

static const struct bench_options defaults = {.load = {.duration_s = 10, .warm_up_s = 2, .timeout_s = 60, .seed = 1}};

const struct command command_bench = {
	.name = "bench",
	.arguments = "[SCENE.json|-|NEW.json]",
	.summary = "put a load on the daemon and measure its answers",
	.remarks =
		"With --rate requests go out at fixed times, whatever the answers, and latencies count from those times: a daemon that\n"
		"stands still is charged with all who would have come meanwhile. Without it a number of clients each ask when they were\n"
		"answered.\n",
	.notes = "In a mix {\"scene\": {}, \"vary\": {\"sun.elevation_deg\": [5.0, 60.0]}} draws that member for every request.\n"
		 "A request is given up after --timeout and a second more, or 60 seconds. Interrupted (130), it tells what was measured "
		 "until\n"
		 "then; of a sweep its whole steps.\n",
	.options = rows,
	.size = sizeof(struct bench_options),
	.defaults = &defaults,
	.words_max = 1,
	.words = WORDS_FILE,
	.run = run_bench,
};
