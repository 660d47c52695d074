/* Files that are written whole or not at all: a process that dies at any moment leaves the old file or the new one. Any thread. */
#ifndef STRATUS_RENDERER_FILE_REPLACE_H
#define STRATUS_RENDERER_FILE_REPLACE_H

#include <stdbool.h>
#include <sys/uio.h>

/* Puts the parts, one behind the other, into the file `path`, readable by all: a temporary file "path.XXXXXX" beside it is written, synced
 * and renamed. false on failure, with errno saying why and nothing changed. */
bool file_replace(const char *path, const struct iovec *parts, int count);

/* Removes what processes that died have left of files that they wrote here; pattern (fnmatch) says how those are called when they are
 * done. Other files stay. The directory need not exist. */
void file_replace_sweep(const char *directory, const char *pattern);

/* mkdir -p. false on failure, with errno saying why. */
bool file_make_directories(const char *path);

#endif
