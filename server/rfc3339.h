/* Points in time as RFC 3339 writes them. Any thread. */
#ifndef STRATUS_SERVER_RFC3339_H
#define STRATUS_SERVER_RFC3339_H

#include <stdbool.h>

/* Reads "2003-10-17T12:30:30.5-07:00", strictly: every part, an offset or Z, a day that exists; a 60th second only as the last of a UTC
 * day. Sets the Julian day of universal time. false when the text is anything else. */
bool rfc3339_parse(const char *text, double *julian_day);

#endif
