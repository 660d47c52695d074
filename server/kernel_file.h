/* The file of the Mie kernel table: found, or made. Any thread. */
#ifndef STRATUS_SERVER_KERNEL_FILE_H
#define STRATUS_SERVER_KERNEL_FILE_H

#include "renderer/optics/kernel.h"

/* Loads `path` (NULL: mie.kernel beside the program), else mie.kernel in the state directory, which is generated when missing or damaged
 * (some seconds, progress in the log). NULL and a log line on failure. The caller destroys the kernel. */
struct kernel *kernel_file_open(const char *path, const char *state_dir);

#endif
