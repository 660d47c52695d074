/* Scenes in order as the frames of a film. */
#ifndef STRATUS_CLIENTS_FILM_RUN_H
#define STRATUS_CLIENTS_FILM_RUN_H

#include "clients/http_pool.h"
#include "clients/scene_list.h"

struct film_settings {
	struct pool_settings pool;
	const char *path; /* as film_is_named wants it */
	double frames_per_s;
};

/* All frames, whole or no film: the first that is refused ends it. An enum client_exit. */
int film_run(const struct client *client, const struct film_settings *settings, const struct scene_list *list);

#endif
