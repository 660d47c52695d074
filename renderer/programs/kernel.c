/* stratus-kernel: computes the Mie kernel table that the daemon reads at start. */
#include "renderer/optics/kernel.h"

#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

enum { EXIT_USAGE = 2, THREADS_MAX = 1024 };

static const char usage[] = "usage: stratus-kernel -o FILE [--threads N]\n"
			    "\n"
			    "Computes the Mie kernel table (some seconds) and writes it to FILE.\n"
			    "\n"
			    "  -o, --output FILE  where to; replaced in one step when complete\n"
			    "  -t, --threads N    1..1024; all processors unless told\n"
			    "  -h, --help         this text\n"
			    "\n"
			    "Exit status: 0 done, 1 not computed or not written, 2 wrong usage.\n";

struct options {
	const char *output;
	int threads;
};

/* EXIT_SUCCESS to go on, anything else to leave with; -1 to leave with success after --help. */
static int parse_options(int argc, char **argv, struct options *options)
{
	static const struct option names[] = {
		{"output", required_argument, NULL, 'o'}, {"threads", required_argument, NULL, 't'}, {"help", no_argument, NULL, 'h'}, {0}};
	for (int option; (option = getopt_long(argc, argv, "o:t:h", names, NULL)) != -1;) {
		char *end = NULL;
		switch (option) {
		case 'o':
			options->output = optarg;
			break;
		case 't':
			errno = 0;
			long threads = strtol(optarg, &end, 10);
			if (errno || end == optarg || *end || threads < 1 || threads > THREADS_MAX) {
				fprintf(stderr, "stratus-kernel: --threads %s: not a number in 1..%d\n", optarg, THREADS_MAX);
				return EXIT_USAGE;
			}
			options->threads = (int)threads;
			break;
		case 'h':
			fputs(usage, stdout);
			return -1;
		default:
			fputs(usage, stderr);
			return EXIT_USAGE;
		}
	}
	if (optind < argc)
		fprintf(stderr, "stratus-kernel: unexpected argument %s\n", argv[optind]);
	else if (!options->output || !*options->output)
		fputs("stratus-kernel: -o FILE is missing\n", stderr);
	else
		return EXIT_SUCCESS;
	return EXIT_USAGE;
}

struct progress_line {
	bool terminal;
	int shown; /* percent */
};

/* A terminal sees one line that counts; a log sees a line every quarter. */
static void show_progress(void *context, double done)
{
	struct progress_line *line = context;
	int percent = (int)(100 * done), step = line->terminal ? 1 : 25;
	if (percent / step <= line->shown / step)
		return;
	line->shown = percent;
	fprintf(stderr, line->terminal ? "\rMie kernel table: %3d %%" : "Mie kernel table: %d %%\n", percent / step * step);
}

int main(int argc, char **argv)
{
	struct options options = {0};
	int status = parse_options(argc, argv, &options);
	if (status != EXIT_SUCCESS)
		return status < 0 ? EXIT_SUCCESS : status;

	struct timespec start, end;
	clock_gettime(CLOCK_MONOTONIC, &start);
	struct progress_line line = {.terminal = isatty(STDERR_FILENO)};
	bool ok = kernel_generate(options.output, options.threads, show_progress, &line);
	clock_gettime(CLOCK_MONOTONIC, &end);
	if (line.terminal)
		fputc('\n', stderr);
	if (!ok)
		return EXIT_FAILURE;
	double seconds = (double)(end.tv_sec - start.tv_sec) + 1e-9 * (double)(end.tv_nsec - start.tv_nsec);
	fprintf(stderr, "stratus-kernel: wrote %s in %.1f s\n", options.output, seconds);
	return EXIT_SUCCESS;
}
