/* Where a command's scene comes from: a file, standard input or a preset, and changes on top. */
#ifndef STRATUS_CLIENTS_SCENE_SOURCE_H
#define STRATUS_CLIENTS_SCENE_SOURCE_H

#include "clients/client.h"

#include <jansson.h>

struct scene_source {
	const char *file;      /* "-": standard input; NULL: none */
	const char *preset;    /* or NULL; not beside a file */
	struct text_list sets; /* assignments in the order given */
};

/* Rows for the table of a command whose options hold a struct scene_source. */
/* clang-format off */
#define SCENE_SOURCE_ROWS(type, member)                                                                                                  \
	TEXT_ROW("preset", 0, "NAME", WORDS_PRESET, type, member.preset, "start from one of the daemon's scenes"),                       \
	LIST_ROW("set", "member=value", WORDS_MEMBER, type, member.sets,                                                                 \
		 "change the scene: sun.elevation_deg=10, camera.position_m=[0,0,3000]; repeatable")
/* clang-format on */

/* Takes the word that may name a file, or NULL. false after a message when there is a preset besides. */
bool scene_source_take(struct scene_source *source, const char *file);

/* An enum client_exit; *scene is the caller's on CLIENT_OK, else NULL after a message. Without file and preset an empty object. */
int scene_source_load(const struct client *client, const struct scene_source *source, json_t **scene);

#endif
