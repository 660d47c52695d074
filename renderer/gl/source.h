/* Assembles the text of a shader out of printed lines and files that include each other. Any thread. */
#ifndef STRATUS_RENDERER_GL_SOURCE_H
#define STRATUS_RENDERER_GL_SOURCE_H

#include <stdbool.h>
#include <stddef.h>

enum { SOURCE_FILES_MAX = 32 };

struct source {
	char *text; /* NUL-terminated, owned */
	size_t length, capacity;
	char files[SOURCE_FILES_MAX][64]; /* already included; the index is the file number in #line */
	int file_count;
	bool failed; /* out of memory: text is incomplete */
};

/* Appends formatted text to a zeroed or used source. */
__attribute__((format(printf, 2, 3))) void source_print(struct source *source, const char *format, ...);

/* Appends a file of the tree ("shaders/..."), from directory `shader_dir` (its own "shaders/" left out) or the embedded ones, and in place
 * of its lines `#include "FILE"` those files, each once. false and a log line when a file is missing. */
bool source_include(struct source *source, const char *shader_dir, const char *file);

/* Frees the text; takes a zeroed source. */
void source_finish(struct source *source);

#endif
