/* Scenes on the client's side: JSON objects, changed by the command line and checked by the server alone. */
#ifndef STRATUS_CLIENTS_SCENE_EDIT_H
#define STRATUS_CLIENTS_SCENE_EDIT_H

#include <jansson.h>
#include <stdbool.h>

/* A file's scene; "-" is standard input. NULL after a message. The caller owns the reference. */
json_t *scene_read(const char *path);

/* Sets `member=value`: a dotted path, whose objects are made as needed, and a value read as JSON, or else taken as a string. false
 * after a message. */
bool scene_set(json_t *scene, const char *assignment);

/* "png" or "exr", as the extension of a file says; NULL: another one. */
const char *scene_format_of(const char *path);

/* Lets the extension of a file (.png, .exr) choose output.format, over the scene's own when `anyway`. false: out of memory. */
bool scene_set_format(json_t *scene, const char *path, bool anyway);

#endif
