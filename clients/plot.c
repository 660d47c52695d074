#include "clients/plot.h"

#include "clients/client.h"
#include "clients/output_file.h"

#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/wait.h>
#include <unistd.h>

static const char *extension_of(const char *path)
{
	const char *dot = strrchr(path, '.');
	return dot ? dot : "";
}

bool plot_is_named(const char *path)
{
	return strcasecmp(extension_of(path), ".png") == 0 || strcasecmp(extension_of(path), ".svg") == 0;
}

static void tell_of_gnuplot(void)
{
	client_error("figures want gnuplot, which is not installed (apt-get install gnuplot-nox)");
}

bool plot_check(const char *path)
{
	if (system("command -v gnuplot >/dev/null") != 0) {
		tell_of_gnuplot();
		return false;
	}
	return output_file_check(path);
}

/* false after a message, when a whole figure found no place. */
static bool finish(struct plot *plot, bool whole)
{
	const bool done = output_file_end(plot->temporary, plot->path, whole);
	free(plot->path);
	*plot = (struct plot){0};
	return done;
}

/* A text in single quotes, in which gnuplot doubles them. */
static void write_quoted(FILE *to, const char *text)
{
	fputc('\'', to);
	for (; *text; text++)
		fputs(*text == '\'' ? "''" : (const char[]){*text, '\0'}, to);
	fputc('\'', to);
}

bool plot_begin(struct plot *plot, const char *path, int width, int height)
{
	*plot = (struct plot){.path = strdup(path)};
	if (!plot->path) {
		client_error("out of memory");
		return false;
	}
	signal(SIGPIPE, SIG_IGN); /* a gnuplot that is not there is told by its status */
	plot->temporary = output_file_begin(path);
	if (plot->temporary && !(plot->to = popen("gnuplot", "we")))
		client_error("gnuplot: %s", strerror(errno));
	if (!plot->to) {
		finish(plot, false);
		return false;
	}
	const bool vector = strcasecmp(extension_of(path), ".svg") == 0;
	fprintf(plot->to, "set terminal %s size %d,%d font 'sans,%d' background 'white'\nset output ", vector ? "svg" : "pngcairo", width,
		height, vector ? 13 : 10);
	write_quoted(plot->to, plot->temporary);
	fputs("\nset border 3 lw 1; set xtics nomirror out; set ytics nomirror out; set grid xtics ytics lc rgb '#dddddd' lw 1 dt 1\n",
	      plot->to);
	return true;
}

int plot_end(struct plot *plot)
{
	const int status = pclose(plot->to);
	bool good = status == 0;
	if (WIFEXITED(status) && WEXITSTATUS(status) == 127)
		tell_of_gnuplot();
	else if (!good)
		client_error("%s: gnuplot failed", plot->path);
	good = finish(plot, good) && good;
	return good ? CLIENT_OK : CLIENT_UNWRITABLE;
}
