/* The named scenes of the daemon. */
#ifndef STRATUS_CLIENTS_PRESET_LIST_H
#define STRATUS_CLIENTS_PRESET_LIST_H

#include "clients/client.h"

#include <jansson.h>

/* Asks the daemon for its presets. An enum client_exit; *presets (an object, name to scene) is the caller's on CLIENT_OK. */
int preset_list_fetch(const struct client *client, json_t **presets);

#endif
