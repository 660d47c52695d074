#include "server/entity_tag.h"

#include <stdio.h>
#include <string.h>

void entity_tag_of(const void *bytes, size_t size, char tag[static ENTITY_TAG_SIZE])
{
	char digest[DIGEST_SIZE];
	digest_of(bytes, size, digest);
	snprintf(tag, ENTITY_TAG_SIZE, "\"%s\"", digest);
}

bool entity_tag_matches(const char *if_none_match, const char *tag)
{
	if (!if_none_match)
		return false;
	const char *c = if_none_match + strspn(if_none_match, " \t");
	if (strcmp(c, "*") == 0)
		return true;
	size_t tag_length = strlen(tag);
	while (*c) {
		if (strncmp(c, "W/", 2) == 0)
			c += 2;
		const char *close = *c == '"' ? strchr(c + 1, '"') : NULL;
		if (!close)
			return false;
		if ((size_t)(close + 1 - c) == tag_length && strncmp(c, tag, tag_length) == 0)
			return true;
		c = close + 1;
		c += strspn(c, " \t,");
	}
	return false;
}
