/* What libmicrohttpd reads is looked at first, up to the end of a request's first line.
 *
 * The library closes a connection without a word when no request can be made of its first line, takes a zero byte for an empty line, and
 * waits for the end of a line however impossible its beginning is (0.9.75); nobody is asked before. It reads by recv, or by
 * gnutls_record_recv, though, which the dynamic linker finds in this program first (as in library_answers.h). So what can be no request is
 * answered as soon as it can be known, and the library sees the connection end there. All else passes unchanged.
 *
 * A later request on a connection is looked at where it is known where it begins: not behind one in chunks, nor where one was sent before
 * the answer to another.
 */
#ifndef STRATUS_SERVER_LIBRARY_READS_H
#define STRATUS_SERVER_LIBRARY_READS_H

#include <microhttpd.h>
#include <stdint.h>

struct service;
struct connection;

/* All of them on the thread that the library serves the connection with. A connection that there is no memory for is not looked at. */
void library_reads_open(struct service *service, struct MHD_Connection *connection, struct connection *socket);
void library_reads_close(struct MHD_Connection *connection);
/* A request was answered that had so many bytes, from its method to its end; 0: not known. */
void library_reads_end(struct MHD_Connection *connection, uint64_t bytes);

/* For what is no request: a connection's. NULL: not known. */
struct service *library_reads_service(struct MHD_Connection *connection);

#endif
