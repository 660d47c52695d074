/* JSON trees into scene members, by the table of scene_fields.h. Any thread.
 *
 * Everything wrong is added to the problem under its JSON pointer; a member that is wrong keeps its default, so that the checks across
 * members (scene_rules.h) can go on.
 */
#ifndef STRATUS_SERVER_SCENE_JSON_H
#define STRATUS_SERVER_SCENE_JSON_H

#include "server/problem.h"
#include "server/scene_fields.h"

#include <jansson.h>

/* Reads a whole scene. input starts as scene_input_default(). */
void scene_json_read(const json_t *root, struct scene_input *input, struct problem *problem);

/* Reads one member; pointer names it in the problem. */
void scene_json_read_field(const struct scene_field *field, const json_t *value, const char *pointer, struct scene_input *input,
			   struct problem *problem);

#endif
