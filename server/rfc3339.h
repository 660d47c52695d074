/* Points in time as RFC 3339 writes them. Any thread. */
#ifndef STRATUS_SERVER_RFC3339_H
#define STRATUS_SERVER_RFC3339_H

#include <stdbool.h>

enum { RFC3339_SIZE = sizeof "2003-10-17T19:30:30.500Z" };

/* Reads "2003-10-17T12:30:30.5-07:00", strictly: every part, an offset or Z, a day that exists; a 60th second only as the last of a UTC
 * day. Sets the Julian day of universal time, rounded to milliseconds. false when the text is anything else, or in another year of
 * universal time than 0000 to 9999. */
bool rfc3339_parse(const char *text, double *julian_day);

/* Writes universal time, with milliseconds where there are any; what rfc3339_parse reads back as the same number. julian_day: one that it
 * gave. */
void rfc3339_format(double julian_day, char text[static RFC3339_SIZE]);

#endif
