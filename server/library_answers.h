/* What libmicrohttpd cannot read it answers by itself: with HTML of its own, after some faults with its header twice (0.9.75), and nobody
 * is asked before. All its answers go through MHD_queue_response, though, which the dynamic linker finds in this program first: so that all
 * of them are problems like any other here. Answers that are meant go by library_queue_response.
 */
#ifndef STRATUS_SERVER_LIBRARY_ANSWERS_H
#define STRATUS_SERVER_LIBRARY_ANSWERS_H

#include <microhttpd.h>

/* MHD_queue_response of the library. HTTP thread. */
enum MHD_Result library_queue_response(struct MHD_Connection *connection, unsigned status, struct MHD_Response *response);

#endif
