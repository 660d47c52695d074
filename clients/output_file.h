/* Results on disk: whole or not at all. */
#ifndef STRATUS_CLIENTS_OUTPUT_FILE_H
#define STRATUS_CLIENTS_OUTPUT_FILE_H

#include <stdbool.h>
#include <stddef.h>

/* Writes a file beside its final name and renames it, so that nobody sees half of it and an old one survives a failure. "-" is standard
 * output; devices and pipes are written directly. false after a message. */
bool output_file_write(const char *path, const void *data, size_t size);

/* Can a file be written there? Asked before work whose result would be lost. false after a message. */
bool output_file_check(const char *path);

/* For what another program writes: makes an empty file beside the final name, and returns its name for output_file_end. NULL after a
 * message. */
char *output_file_begin(const char *path);

/* Gives it the final name if it is whole, else removes it; frees temporary. NULL as temporary: there is nothing, which is an error only of
 * something whole. false after a message. */
bool output_file_end(char *temporary, const char *path, bool whole);

#endif
