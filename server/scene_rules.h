/* What a table of members cannot say: the rules across members, and the members that are another form of others. Any thread. */
#ifndef STRATUS_SERVER_SCENE_RULES_H
#define STRATUS_SERVER_SCENE_RULES_H

#include "server/problem.h"
#include "server/scene_fields.h"

/* Most pixels of an image, over all its layers. */
enum { SCENE_PIXELS_MAX = 64 << 20 };

/* Replaces other forms (sun by time and place, characteristic radius) by the members they stand for, gives a panorama the size that its
 * shape asks for, then adds every broken rule to the
 * problem. With no problem, input->scene is a scene the renderer takes. */
void scene_rules_apply(struct scene_input *input, struct problem *problem);

#endif
