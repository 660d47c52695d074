/* The canonical form of a scene, and what is derived from it. Any thread.
 *
 * Canonical: JSON without white space, every member with its value, in the order of scene_fields.h, numbers as short as they read back
 * exactly. Two requests mean the same picture when their canonical forms are equal; reading the form gives the form again. A sun given by
 * time and place stays so (in universal time), since files say both.
 */
#ifndef STRATUS_SERVER_SCENE_CANONICAL_H
#define STRATUS_SERVER_SCENE_CANONICAL_H

#include "renderer/scene.h"
#include "server/digest.h"

/* The caller frees; NULL when out of memory. */
char *scene_canonical(const struct scene *scene);

/* The query that stands for the scene: the members that differ from their defaults, "" for the default scene. The caller frees; NULL when
 * out of memory. */
char *scene_canonical_query(const struct scene *scene);

/* Key of what is costly to prepare and shared between frames: dsd, optics, atmosphere. Empty when out of memory. */
void scene_canonical_key(const struct scene *scene, char key[static DIGEST_SIZE]);

#endif
