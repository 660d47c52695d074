/* stratusd --check-config: would the daemon start with these settings? */
#ifndef STRATUS_SERVER_CONFIG_CHECK_H
#define STRATUS_SERVER_CONFIG_CHECK_H

#include "server/config.h"

/* Prints the settings in force and the files that they lead to on standard output, and looks, without starting anything or changing a file,
 * whether the address can be listened on (another daemon may be doing so), the state directory can be written, and the kernel table, the
 * shaders, the image module, the keys and the certificate can be read. Each fault is a line of the log; true when there is none. Variables
 * that look like settings and are none are warnings. The device is not tried. Main thread, before others exist. */
bool config_check(const struct config *config);

/* Do settings that depend on each other fit, and serve no strangers by mistake? A log line for each fault. Every start asks this first.
 * Main thread. */
bool config_is_consistent(const struct config *config);

#endif
