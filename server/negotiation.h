/* Which image format goes out: content negotiation by Accept (RFC 9110). Any thread. */
#ifndef STRATUS_SERVER_NEGOTIATION_H
#define STRATUS_SERVER_NEGOTIATION_H

#include "renderer/scene.h"

/* Content types indexed by enum image_format: "image/png", "image/x-exr". */
extern const char *const image_content_types[IMAGE_FORMAT_COUNT];

/* Chooses for a scene that asks for `wanted`. A type named precisely overrides it, a wildcard never does; accept NULL or empty takes
 * anything. false when the header excludes what would be sent. */
bool negotiation_choose(const char *accept, enum image_format wanted, enum image_format *chosen);

/* Chooses among types, NULL at their end: the one that the header values most, one that it names before one that a wildcard covers, then
 * the earlier. The first when accept is NULL or empty; -1 when the header excludes all. */
int negotiation_choose_type(const char *accept, const char *const *types);

/* Is a Content-Type header JSON? NULL (none sent) counts as JSON; parameters such as charset do not matter. */
bool negotiation_is_json(const char *content_type);

#endif
