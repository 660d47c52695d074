/* What a request's Cache-Control header says (RFC 9111, 5.2.1). Any thread. */
#ifndef STRATUS_SERVER_CACHE_CONTROL_H
#define STRATUS_SERVER_CACHE_CONTROL_H

#include <stdbool.h>

/* Does the header name a directive, such as "no-cache"? Whatever its case and argument. NULL names nothing. */
bool cache_control_names(const char *header, const char *directive);

#endif
