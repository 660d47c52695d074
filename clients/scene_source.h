/* Where a command's scene comes from: a file, standard input or a preset, and changes on top. */
#ifndef STRATUS_CLIENTS_SCENE_SOURCE_H
#define STRATUS_CLIENTS_SCENE_SOURCE_H

#include "clients/client.h"

#include <jansson.h>

struct scene_source {
	const char *file;   /* "-": standard input; NULL: none */
	const char *preset; /* or NULL; not beside a file */
	const char **sets;  /* assignments in the order given */
	int set_count;
};

/* An enum client_exit; *scene is the caller's on CLIENT_OK, else NULL after a message. Without file and preset an empty object. */
int scene_source_load(const struct client *client, const struct scene_source *source, json_t **scene);

#endif
