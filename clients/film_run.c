#include "clients/film_run.h"

#include "clients/film.h"
#include "clients/problem.h"
#include "clients/progress.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { AHEAD = 4 }; /* frames per request at once that may wait for one before them */

struct frame {
	char *png;
	size_t size;
};

struct shoot {
	const struct film_settings *settings;
	const struct scene_list *list;
	struct film *film;
	struct frame *frame; /* of the list; those that came and were not written yet */
	int next, written;
	struct progress progress;
	int retries;
};

static enum pool_next next_frame(void *context, struct pool_job *job)
{
	struct shoot *shoot = context;
	if (shoot->next == shoot->list->count)
		return POOL_END;
	if (shoot->next >= shoot->written + AHEAD * shoot->settings->pool.at_once)
		return POOL_LATER;
	*job = (struct pool_job){shoot->next, json_dumps(shoot->list->item[shoot->next].scene, JSON_COMPACT)};
	shoot->next++;
	return POOL_JOB;
}

/* Everything that is next in order goes to the encoder. */
static bool write_frames(struct shoot *shoot)
{
	bool good = true;
	for (; good && shoot->written < shoot->list->count && shoot->frame[shoot->written].png; shoot->written++) {
		struct frame *frame = &shoot->frame[shoot->written];
		good = film_add(shoot->film, frame->png, frame->size);
		free(frame->png);
		frame->png = NULL;
	}
	return good;
}

static int take_frame(void *context, const struct pool_job *job, struct http_response *response)
{
	struct shoot *shoot = context;
	if (response->status != 200 || strcmp(response->content_type, "image/png") != 0) {
		progress_clear(&shoot->progress);
		fprintf(stderr, "frame %s: ", shoot->list->item[job->index].name);
		problem_print(response);
		return CLIENT_REFUSED;
	}
	shoot->frame[job->index] = (struct frame){response->body, response->size};
	response->body = NULL;
	shoot->progress.made++;
	return write_frames(shoot) ? CLIENT_OK : CLIENT_UNWRITABLE;
}

static void tick(void *context, int busy, int retries)
{
	struct shoot *shoot = context;
	shoot->retries = retries;
	progress_draw(&shoot->progress, busy, retries);
}

int film_run(const struct client *client, const struct film_settings *settings, const struct scene_list *list)
{
	struct shoot shoot = {.settings = settings, .list = list, .progress = {.what = "frames", .total = list->count}};
	const struct pool_work work = {&shoot, next_frame, take_frame, tick};
	char *comment = json_dumps(list->item[0].scene, JSON_COMPACT | JSON_REAL_PRECISION(9));
	int status = CLIENT_USAGE;
	shoot.frame = calloc((size_t)list->count, sizeof *shoot.frame);
	if (shoot.frame && comment) {
		shoot.film = film_begin(settings->path, settings->frames_per_s, comment);
		if (shoot.film) {
			progress_begin(&shoot.progress, client);
			status = http_pool_run(client, &settings->pool, &work);
			const int ended = film_end(shoot.film, status == CLIENT_OK);
			status = status == CLIENT_OK ? ended : status;
			progress_end(&shoot.progress, client, shoot.retries);
		}
	}
	for (int i = 0; shoot.frame && i < list->count; i++)
		free(shoot.frame[i].png);
	free(shoot.frame);
	free(comment);
	return status;
}
