/* What libmicrohttpd cannot read it answers by itself: with HTML of its own, after some faults with its header twice (0.9.75), and nobody
 * is asked before. All its answers go through MHD_queue_response, though, which the dynamic linker finds in this program first: so that all
 * of them are problems like any other here. Answers that are meant go by library_queue_response.
 */
#ifndef STRATUS_SERVER_LIBRARY_ANSWERS_H
#define STRATUS_SERVER_LIBRARY_ANSWERS_H

#include <microhttpd.h>

/* MHD_queue_response of the library. HTTP thread. */
enum MHD_Result library_queue_response(struct MHD_Connection *connection, unsigned status, struct MHD_Response *response);

/* A line that begins no request; that begins a session of TLS; that the client's end has cut off. */
enum library_fault { LINE_MALFORMED, LINE_OF_TLS, LINE_CUT };

/* 400 for a line which the library has not seen whole, nor does. Counted and logged as a request without method and address. HTTP thread.
 */
struct connection;
void library_refuse_line(struct MHD_Connection *connection, struct connection *socket, enum library_fault fault);

#endif
