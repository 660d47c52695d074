/* The file of the Mie kernel table: found, or made. Any thread. */
#ifndef STRATUS_SERVER_KERNEL_FILE_H
#define STRATUS_SERVER_KERNEL_FILE_H

#include "renderer/optics/kernel.h"

#include <limits.h>

/* Loads `path` (NULL: mie.kernel beside the program, or where it is installed), else mie.kernel in the state directory, which is generated
 * when missing or damaged (some seconds, progress in the log). NULL and a log line on failure. The caller destroys the kernel. */
struct kernel *kernel_file_open(const char *path, const char *state_dir);

/* Which file that would load, `path` or, when that is NULL, one of the others; false when there is none, so that it is computed. */
bool kernel_file_find(const char *path, const char *state_dir, char found[static PATH_MAX]);

#endif
