#include "clients/film.h"

#include "clients/client.h"
#include "clients/output_file.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

struct film {
	char *path, *temporary;
	pid_t encoder;
	int pipe;
};

static const struct form {
	const char *extension;
	const char *arguments[12]; /* for ffmpeg: how to encode; the container is the last */
} forms[] = {
	{".mp4", {"-c:v", "libx264", "-preset", "medium", "-crf", "18", "-movflags", "+faststart", "-f", "mp4"}},
	{".webm", {"-c:v", "libvpx-vp9", "-b:v", "0", "-crf", "28", "-row-mt", "1", "-f", "webm"}},
};

static const struct form *form_of(const char *path)
{
	const char *dot = strrchr(path, '.');
	for (size_t i = 0; dot && i < sizeof forms / sizeof *forms; i++)
		if (strcasecmp(dot, forms[i].extension) == 0)
			return &forms[i];
	return NULL;
}

bool film_is_named(const char *path)
{
	return form_of(path) != NULL;
}

/* Sides of 4:2:0 are even; colours are those of the PNG's sRGB, said so that no player has to guess. */
static const char filter[] = "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv";

/* Starts ffmpeg with the reading end of a pipe as its standard input. */
static bool spawn(struct film *film, const struct form *form, double frames_per_s, const char *comment)
{
	char rate[32], *metadata = NULL;
	const char *argv[48] = {"ffmpeg",   "-hide_banner", "-loglevel",    "error",    "-y",
				"-f",       "image2pipe",   "-c:v",         "png",      "-framerate",
				rate,       "-i",           "pipe:0",       "-vf",      filter,
				"-pix_fmt", "yuv420p",      "-colorspace",  "bt709",    "-color_primaries",
				"bt709",    "-color_trc",   "iec61966-2-1", "-metadata"};
	posix_spawn_file_actions_t actions;
	int ends[2], count = 0;
	while (argv[count])
		count++;
	snprintf(rate, sizeof rate, "%.9g", frames_per_s);
	if (asprintf(&metadata, "comment=%s", comment) < 0 || pipe2(ends, O_CLOEXEC) != 0) {
		client_error("ffmpeg: %s", strerror(errno));
		free(metadata);
		return false;
	}
	argv[count++] = metadata;
	for (int i = 0; form->arguments[i]; i++)
		argv[count++] = form->arguments[i];
	argv[count] = film->temporary;
	posix_spawn_file_actions_init(&actions);
	posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
	const int error = posix_spawnp(&film->encoder, "ffmpeg", &actions, NULL, (char *const *)argv, environ);
	posix_spawn_file_actions_destroy(&actions);
	free(metadata);
	close(ends[0]);
	film->pipe = ends[1];
	if (error) {
		film->encoder = 0;
		client_error(error == ENOENT
				     ? "films want ffmpeg, which is not installed (apt-get install ffmpeg); a folder of frames does not"
				     : "ffmpeg: %s",
			     strerror(error));
	}
	return error == 0;
}

struct film *film_begin(const char *path, double frames_per_s, const char *comment)
{
	struct film *film = calloc(1, sizeof *film);
	if (film)
		film->pipe = -1;
	if (!film || !(film->path = strdup(path))) {
		client_error("out of memory");
		film_end(film, false);
		return NULL;
	}
	signal(SIGPIPE, SIG_IGN); /* an encoder that ended is told by write */
	if ((film->temporary = output_file_begin(path)) && spawn(film, form_of(path), frames_per_s, comment))
		return film;
	film_end(film, false);
	return NULL;
}

bool film_add(struct film *film, const void *png, size_t size)
{
	const char *data = png;
	while (size > 0) {
		const ssize_t written = write(film->pipe, data, size);
		if (written < 0 && errno == EINTR)
			continue;
		if (written <= 0) {
			client_error("ffmpeg takes no more frames");
			return false;
		}
		data += written;
		size -= (size_t)written;
	}
	return true;
}

/* Waits for the encoder; true when it is content. */
static bool await_encoder(struct film *film, bool whole)
{
	int status = 0;
	if (film->pipe >= 0)
		close(film->pipe);
	if (film->encoder == 0)
		return false;
	if (!whole)
		kill(film->encoder, SIGKILL); /* of what it writes nothing is kept */
	while (waitpid(film->encoder, &status, 0) < 0 && errno == EINTR)
		;
	return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

int film_end(struct film *film, bool whole)
{
	int status = CLIENT_OK;
	if (!film)
		return status;
	const bool encoded = await_encoder(film, whole);
	if (whole && !encoded) {
		client_error("%s: ffmpeg failed", film->path);
		status = CLIENT_UNWRITABLE;
	}
	if (!output_file_end(film->temporary, film->path, whole && encoded))
		status = CLIENT_UNWRITABLE;
	free(film->path);
	free(film);
	return status;
}
