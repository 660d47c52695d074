/* Entity tags and conditional requests (RFC 9110, 13.1.2). Any thread. */
#ifndef STRATUS_SERVER_ENTITY_TAG_H
#define STRATUS_SERVER_ENTITY_TAG_H

#include "server/digest.h"

#include <stdbool.h>

enum { ENTITY_TAG_SIZE = DIGEST_SIZE + 2 };

/* A strong tag (a quoted digest) of bytes. */
void entity_tag_of(const void *bytes, size_t size, char tag[static ENTITY_TAG_SIZE]);

/* Does an If-None-Match header name the tag? A list or *, compared weakly. NULL and malformed headers name nothing. */
bool entity_tag_matches(const char *if_none_match, const char *tag);

/* Does an If-Match header name the tag? A list or *, compared strongly (RFC 9110, 13.1.1): weak tags name nothing. */
bool entity_tag_is_expected(const char *if_match, const char *tag);

#endif
