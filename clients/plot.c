#include "clients/plot.h"

#include "clients/client.h"

#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
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

static void finish(struct plot *plot)
{
	free(plot->path);
	free(plot->temporary);
	*plot = (struct plot){0};
}

static bool make_temporary(struct plot *plot)
{
	const mode_t mask = umask(0);
	umask(mask);
	const int fd = mkstemp(plot->temporary);
	const bool made = fd >= 0 && fchmod(fd, 0666 & ~mask) == 0;
	if (!made)
		client_error("%s: %s", plot->path, strerror(errno));
	if (fd >= 0)
		close(fd);
	return made;
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
	if (!plot->path || asprintf(&plot->temporary, "%s.XXXXXX", path) < 0) {
		plot->temporary = NULL;
		client_error("out of memory");
		finish(plot);
		return false;
	}
	signal(SIGPIPE, SIG_IGN); /* a gnuplot that is not there is told by its status */
	if (!make_temporary(plot) || !(plot->to = popen("gnuplot", "we"))) {
		finish(plot);
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
		client_error("figures want gnuplot, which is not installed (apt-get install gnuplot-nox)");
	else if (!good)
		client_error("%s: gnuplot failed", plot->path);
	if (good && rename(plot->temporary, plot->path) != 0) {
		client_error("%s: %s", plot->path, strerror(errno));
		good = false;
	}
	if (!good)
		unlink(plot->temporary);
	finish(plot);
	return good ? CLIENT_OK : CLIENT_UNWRITABLE;
}
