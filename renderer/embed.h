/* Files embedded in the binary at build time (scripts/embed.sh). Read-only, any thread. */
#ifndef STRATUS_RENDERER_EMBED_H
#define STRATUS_RENDERER_EMBED_H

#include <stddef.h>
#include <string.h>

struct embedded_file {
	const char *name; /* path in the source tree; NULL ends the table */
	const char *data; /* `size` bytes, followed by a NUL */
	size_t size;
};

extern const struct embedded_file shader_files[];   /* shaders/...glsl */
extern const struct embedded_file resource_files[]; /* openapi.yaml, server/pages/..., server/presets/...json */

static inline const struct embedded_file *embedded_find(const struct embedded_file *table, const char *name)
{
	for (; table->name; table++)
		if (strcmp(table->name, name) == 0)
			return table;
	return NULL;
}

#endif
