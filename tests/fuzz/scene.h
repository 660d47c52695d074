/* A scene that was read from bytes of strangers, and what must hold for every one. */
#ifndef STRATUS_FUZZ_SCENE_H
#define STRATUS_FUZZ_SCENE_H

#include "server/problem.h"
#include "server/scene_fields.h"

/* Aborts unless the problem can be told, and, when there is none, the scene's canonical form and its query both read back as the scene. */
void scene_require_consistent(const struct scene_input *input, const struct problem *problem);

#endif
