#include "server/entity_tag.h"

#include <stdio.h>
#include <string.h>

void entity_tag_of(const void *bytes, size_t size, char tag[static ENTITY_TAG_SIZE])
{
	char digest[DIGEST_SIZE];
	digest_of(bytes, size, digest);
	snprintf(tag, ENTITY_TAG_SIZE, "\"%s\"", digest);
}

static bool names(const char *header, const char *tag, bool weak_too)
{
	if (!header)
		return false;
	const char *c = header + strspn(header, " \t");
	if (strcmp(c, "*") == 0)
		return true;
	size_t tag_length = strlen(tag);
	while (*c) {
		const bool weak = strncmp(c, "W/", 2) == 0;
		if (weak)
			c += 2;
		const char *close = *c == '"' ? strchr(c + 1, '"') : NULL;
		if (!close)
			return false;
		if ((size_t)(close + 1 - c) == tag_length && strncmp(c, tag, tag_length) == 0 && (weak_too || !weak))
			return true;
		c = close + 1;
		c += strspn(c, " \t,");
	}
	return false;
}

bool entity_tag_matches(const char *if_none_match, const char *tag)
{
	return names(if_none_match, tag, true);
}

bool entity_tag_is_expected(const char *if_match, const char *tag)
{
	return names(if_match, tag, false);
}
