/* The file that says which keys the service takes. A line is
 *
 *	NAME sha256:HASH [requests_per_minute=N] [megapixels_per_minute=X]
 *
 * NAME: 1 to 32 letters, digits, '-', '_' and '.'; it stands in logs and metrics. HASH: 64 hexadecimal digits (api_key.h). A limit that is
 * left out is none. Empty lines and lines that begin with '#' are skipped.
 */
#ifndef STRATUS_SERVER_KEY_FILE_H
#define STRATUS_SERVER_KEY_FILE_H

#include "server/api_key.h"

#include <stddef.h>

/* As many as metrics may have values of a label. */
enum { KEY_NAME_SIZE = 33, KEYS_MAX = 256 };

struct key_line {
	char name[KEY_NAME_SIZE];
	unsigned char hash[API_KEY_HASH_BYTES];
	double requests_per_minute, megapixels_per_minute; /* INFINITY: no limit */
};

struct key_file {
	size_t count;
	struct key_line line[KEYS_MAX];
};

/* Reads all of it. false when anything is wrong, each fault a line of the log with the line's number; *file is of no use then. A file that
 * others may write is a fault, one that others may read a warning. Any thread. */
bool key_file_read(const char *path, struct key_file *file);

/* stratusd --new-key: prints a new key and its line on standard output, what they are on standard error. false and a message there when
 * the name is none. */
bool key_file_print_new(const char *name);

#endif
