#include "clients/progress.h"

#include "clients/clock.h"

#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

enum { BAR_MAX = 40, TEXT_MAX = 78 /* columns besides the bar */ };

static int columns(void)
{
	struct winsize size;
	return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

static double rate_of(const struct progress *progress)
{
	const double seconds = clock_s() - progress->start_s;
	return seconds > 0 ? (progress->made + progress->failed) / seconds : 0;
}

void progress_begin(struct progress *progress, const struct client *client)
{
	progress->made = progress->failed = 0;
	progress->start_s = clock_s();
	progress->shown = !client->quiet && isatty(STDERR_FILENO);
}

static void write_time_left(char *text, size_t size, double seconds)
{
	const long whole = (long)(seconds + 0.5);
	if (whole >= 3600)
		snprintf(text, size, "%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
	else
		snprintf(text, size, "%ld:%02ld", whole / 60, whole % 60);
}

void progress_draw(const struct progress *progress, int busy, int retries)
{
	static const char full[BAR_MAX + 1] = "########################################";
	char left[32] = "-:--", extra[64] = "";
	if (!progress->shown)
		return;
	const int done = progress->kept + progress->made + progress->failed;
	const int room = columns() - TEXT_MAX, width = room < 0 ? 0 : room > BAR_MAX ? BAR_MAX : room;
	const int filled = progress->total ? (int)((double)width * done / progress->total) : width;
	const double rate = rate_of(progress);
	if (rate > 0)
		write_time_left(left, sizeof left, (progress->total - done) / rate);
	if (progress->failed)
		snprintf(extra, sizeof extra, ", %d failed", progress->failed);
	fprintf(stderr, "\r\033[K%s%.*s%*s%s %d/%d %s  %.2f/s  %s left%s", width ? "[" : "", filled, full, width - filled, "",
		width ? "]" : "", done, progress->total, progress->what, rate, left, extra);
	if (busy)
		fprintf(stderr, "  daemon busy, %d waiting", busy);
	else if (retries)
		fprintf(stderr, "  %d retries", retries);
	fflush(stderr);
}

void progress_clear(const struct progress *progress)
{
	if (progress->shown)
		fputs("\r\033[K", stderr);
}

void progress_end(const struct progress *progress, const struct client *client, int retries)
{
	const double seconds = clock_s() - progress->start_s;
	progress_clear(progress);
	if (client->quiet)
		return;
	fprintf(stderr, "%d %s made in %.1f s (%.2f/s)", progress->made, progress->what, seconds,
		progress->made / (seconds > 0 ? seconds : 1));
	if (progress->kept)
		fprintf(stderr, ", %d kept", progress->kept);
	if (progress->failed)
		fprintf(stderr, ", %d failed", progress->failed);
	if (retries)
		fprintf(stderr, ", %d retries", retries);
	fputc('\n', stderr);
}
