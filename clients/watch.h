/* Waiting until a file is another. */
#ifndef STRATUS_CLIENTS_WATCH_H
#define STRATUS_CLIENTS_WATCH_H

#include <stdbool.h>
#include <sys/stat.h>

struct watch {
	const char *path;
	struct stat seen;
	bool exists;
};

/* Remembers how the file is now; it need not exist. */
void watch_begin(struct watch *watch, const char *path);

/* Returns when the file has changed and is there: written, or replaced as editors do. Asks ten times a second, which holds on any file
 * system. A file that is written goes on changing; it has changed when it stayed the same for a tenth of a second. */
void watch_await(struct watch *watch);

#endif
