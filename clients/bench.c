/* stratus bench: a load on the daemon, and how it bears it. */
#include "clients/bench/report.h"
#include "clients/commands.h"
#include "clients/output_file.h"
#include "clients/scene_source.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OPEN_CONNECTIONS = 1024, CLOSED_CONNECTIONS = 4, CONNECTIONS_MAX = 65536 };

struct bench_options {
	struct scene_source source;
	const char *mix, *path, *json;
	struct load_settings load;
};

enum {
	PRESET = 'p',
	SET = 's',
	RATE = 'r',
	RANDOM = 'R',
	CONNECTIONS = 'c',
	DURATION = 'd',
	WARM_UP = 'w',
	MIX = 'm',
	GET = 'g',
	JSON = 'j',
	SEED = 'x'
};

/* A number of an option within its bounds. false after a message. */
static bool read_number(const char *option, const char *text, double low, double high, double *number)
{
	char *end;
	*number = strtod(text, &end);
	if (end != text && !*end && *number >= low && *number <= high)
		return true;
	client_error("%s wants a number from %g to %g, not \"%s\"", option, low, high, text);
	return false;
}

static bool take_number(struct bench_options *options, int option)
{
	double number;
	bool good;
	switch (option) {
	case RATE:
		return read_number("--rate", optarg, 0.01, 1e6, &options->load.rate);
	case DURATION:
		return read_number("--duration", optarg, 0.1, 86400, &options->load.duration_s);
	case WARM_UP:
		return read_number("--warm-up", optarg, 0, 3600, &options->load.warm_up_s);
	case CONNECTIONS:
		good = read_number("--connections", optarg, 1, CONNECTIONS_MAX, &number);
		options->load.connections = (int)number;
		return good;
	default:
		good = read_number("--seed", optarg, 0, 4294967295.0, &number);
		options->load.seed = (uint64_t)number;
		return good;
	}
}

static int take_option(struct client *client, struct bench_options *options, int option)
{
	switch (option) {
	case PRESET:
		options->source.preset = optarg;
		return -1;
	case SET:
		options->source.sets[options->source.set_count++] = optarg;
		return -1;
	case MIX:
		options->mix = optarg;
		return -1;
	case GET:
		options->path = optarg;
		return -1;
	case JSON:
		options->json = optarg;
		return -1;
	case RANDOM:
		options->load.random_arrivals = true;
		return -1;
	case RATE:
	case DURATION:
	case WARM_UP:
	case CONNECTIONS:
	case SEED:
		return take_number(options, option) ? -1 : CLIENT_USAGE;
	default:
		return client_option(client, option);
	}
}

/* Negative: go on; else the exit status. */
static int read_options(struct client *client, struct bench_options *options, int argc, char **argv)
{
	static const struct option table[] = {{"rate", required_argument, NULL, RATE},
					      {"random", no_argument, NULL, RANDOM},
					      {"connections", required_argument, NULL, CONNECTIONS},
					      {"duration", required_argument, NULL, DURATION},
					      {"warm-up", required_argument, NULL, WARM_UP},
					      {"mix", required_argument, NULL, MIX},
					      {"get", required_argument, NULL, GET},
					      {"json", required_argument, NULL, JSON},
					      {"seed", required_argument, NULL, SEED},
					      {"preset", required_argument, NULL, PRESET},
					      {"set", required_argument, NULL, SET},
					      CLIENT_LONG_OPTIONS,
					      {0}};
	for (int option; (option = getopt_long(argc, argv, CLIENT_SHORT_OPTIONS, table, NULL)) != -1;) {
		const int end = take_option(client, options, option);
		if (end >= 0)
			return end;
	}
	options->source.file = argv[optind];
	const bool scene = options->source.file || options->source.preset || options->source.set_count > 0;
	if (argc - optind > 1 || (options->source.file && options->source.preset))
		client_error("bench takes one scene: a file, - or a preset");
	else if (scene + (options->mix != NULL) + (options->path != NULL) > 1)
		client_error("bench takes a scene, --mix or --get, one of them");
	else if (options->load.random_arrivals && options->load.rate <= 0)
		client_error("--random is for an open load, by --rate: in a closed one each client asks when it was answered");
	else
		return -1;
	return CLIENT_USAGE;
}

static int make_mix(const struct client *client, const struct bench_options *options, struct mix **mix)
{
	if (options->mix)
		return mix_read(options->mix, mix);
	json_t *scene = NULL;
	int status = options->path ? CLIENT_OK : scene_source_load(client, &options->source, &scene);
	if (options->path && (*options->path != '/' || strpbrk(options->path, " \r\n"))) {
		client_error("--get wants a path, such as /healthz");
		return CLIENT_USAGE;
	}
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

static int run_bench(struct client *client, int argc, char **argv)
{
	const char **sets = calloc((size_t)argc, sizeof *sets);
	struct bench_options options = {.source.sets = sets, .load = {.duration_s = 10, .warm_up_s = 2, .timeout_s = 60, .seed = 1}};
	struct load_result result = {0};
	struct mix *mix = NULL;
	int status = CLIENT_USAGE;
	if (!sets)
		goto cleanup;
	status = read_options(client, &options, argc, argv);
	if (status >= 0)
		goto cleanup;
	if (options.load.connections == 0)
		options.load.connections = options.load.rate > 0 ? OPEN_CONNECTIONS : CLOSED_CONNECTIONS;
	if (client->timeout_s > 0)
		options.load.timeout_s = client->timeout_s + 1; /* the daemon's answer that it was too late should still be heard */
	status = make_mix(client, &options, &mix);
	if (status == CLIENT_OK)
		status = load_run(client, mix, &options.load, &result);
	if (status == CLIENT_OK)
		status = tell(client, &options, mix, &result);
	if (status == CLIENT_OK && histogram_count(result.good) == 0)
		status = CLIENT_REFUSED;
cleanup:
	load_result_finish(&result);
	mix_destroy(mix);
	free(sets);
	return status;
}

const struct command command_bench = {
	.name = "bench",
	.arguments = "[SCENE.json|-]",
	.summary = "put a load on the daemon and measure its answers",
	.help = "With --rate requests go out at fixed times, whatever the answers, and latencies count from those times: a daemon that "
		"stands\n"
		"still is charged with all who would have come meanwhile. Without it a number of clients each ask when they were "
		"answered.\n\n"
		"  --rate N           requests per second; without it a closed load\n"
		"  --random           arrivals at random times (a Poisson process) instead of even ones\n"
		"  --connections N    clients of a closed load (4); most connections of an open one (1024)\n"
		"  --duration S       seconds that are measured (10)\n"
		"  --warm-up S        seconds of load before them (2)\n"
		"  --mix FILE         kinds of requests, a JSON object a line: name, weight, scene, vary, or path\n"
		"  --get PATH         fetch a path instead of a scene\n"
		"  --preset NAME      one of the daemon's scenes\n"
		"  --set member=value change the scene; repeatable\n"
		"  --seed N           of what is drawn at random (1)\n"
		"  --json FILE        the figures as JSON as well; - is standard output, instead of the tables\n"
		"In a mix {\"scene\": {}, \"vary\": {\"sun.elevation_deg\": [5.0, 60.0]}} draws that member for every request.\n"
		"A request is given up after --timeout and a second more, or 60 seconds.\n",
	.run = run_bench,
};
