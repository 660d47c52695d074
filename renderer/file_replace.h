/* Files that are written whole or not at all: a process that dies at any moment leaves the old file or the new one. Any thread. */
#ifndef STRATUS_RENDERER_FILE_REPLACE_H
#define STRATUS_RENDERER_FILE_REPLACE_H

#include <limits.h>
#include <stdbool.h>
#include <stddef.h>
#include <sys/uio.h>

/* Puts the parts, one behind the other, into the file `path`, readable by all: a temporary file "path.XXXXXX" beside it is written, synced
 * and renamed. false on failure, with errno saying why and nothing changed. */
bool file_replace(const char *path, const struct iovec *parts, int count);

/* The same in steps, for what comes in pieces. begin opens the temporary file, which the caller writes, and at last closes; negative on
 * failure. finish syncs it and gives it the name `path`, which may be in another folder; on failure it stays, for the caller to unlink. */
int file_replace_begin(const char *path, char temporary[static PATH_MAX]);
bool file_replace_finish(int fd, const char *temporary, const char *path);

/* Writes all of it. false on failure, with errno saying why. */
bool file_write_all(int fd, const void *bytes, size_t size);

/* Makes a new, or a removed, name of a file last. What cannot be synced costs no more than that. */
void file_sync_directory_of(const char *path);

/* Removes what processes that died have left of files that they wrote here; pattern (fnmatch) says how those are called when they are
 * done. Other files stay. The directory need not exist. */
void file_replace_sweep(const char *directory, const char *pattern);

/* mkdir -p. false on failure, with errno saying why. */
bool file_make_directories(const char *path);

#endif
