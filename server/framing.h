/* Whether it is beyond doubt where a request ends, and what it says. libmicrohttpd takes the first of two lengths that contradict each
 * other; a proxy in front may take the second, and what lies between is then a request that it never saw (RFC 9112, 6.3 and 11.2). */
#ifndef STRATUS_SERVER_FRAMING_H
#define STRATUS_SERVER_FRAMING_H

#include <microhttpd.h>

/* NULL, or what is wrong, for people. The connection must be closed then. version: as in the request line, "HTTP/1.1". HTTP thread, headers
 * in. */
const char *framing_fault(struct MHD_Connection *connection, const char *version);

#endif
