#include "server/cache_control.h"

#include <stddef.h>
#include <string.h>
#include <strings.h>

/* Past a token or a quoted string, whose commas separate nothing. */
static const char *skip_item(const char *c)
{
	if (*c != '"')
		return c + strcspn(c, "\",");
	for (c++; *c && *c != '"'; c++)
		c += *c == '\\' && c[1];
	return *c ? c + 1 : c;
}

bool cache_control_names(const char *header, const char *directive)
{
	const size_t wanted = strlen(directive);
	for (const char *c = header; c && *c;) {
		c += strspn(c, " \t,");
		if (strcspn(c, " \t,=") == wanted && strncasecmp(c, directive, wanted) == 0)
			return true;
		while (*c && *c != ',')
			c = skip_item(c);
	}
	return false;
}
