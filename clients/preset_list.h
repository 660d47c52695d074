/* The named scenes of the daemon. */
#ifndef STRATUS_CLIENTS_PRESET_LIST_H
#define STRATUS_CLIENTS_PRESET_LIST_H

#include "clients/client.h"

#include <jansson.h>

/* Asks the daemon for its presets. An enum client_exit; *presets is the caller's on CLIENT_OK, else NULL: an array of objects with name,
 * title, description and scene. */
int preset_list_fetch(const struct client *client, json_t **presets);

/* The scene of that name, borrowed from the list; NULL after a message when there is none. */
json_t *preset_list_find(const json_t *presets, const char *name);

#endif
