/* Results on disk: whole or not at all. */
#ifndef STRATUS_CLIENTS_OUTPUT_FILE_H
#define STRATUS_CLIENTS_OUTPUT_FILE_H

#include <stdbool.h>
#include <stddef.h>

/* Writes a file beside its final name and renames it, so that nobody sees half of it and an old one survives a failure. "-" is standard
 * output; devices and pipes are written directly. false after a message. */
bool output_file_write(const char *path, const void *data, size_t size);

#endif
