/* Connections that are closed before their client has sent all it means to: an answer such as 413 comes before the end of a body. Were such
 * a socket closed at once, the system would answer what still comes with a reset, and a client that writes first and reads then would see
 * that alone (RFC 9112, 9.6). So the answer's end is told, what comes is read and thrown away for a while, and then the socket is closed.
 *
 * Nothing here waits: whoever polls calls lingering_work when lingering_fd can be read, and now and then.
 */
#ifndef STRATUS_SERVER_LINGERING_H
#define STRATUS_SERVER_LINGERING_H

#include <stdbool.h>
#include <stddef.h>

/* As nginx has it: for so long in all, and for so long after the last byte. */
#define LINGERING_MS       30000.0
#define LINGERING_STILL_MS 5000.0
/* More are closed at once. */
enum { LINGERING_MAX = 64 };

struct lingering;

/* NULL, with errno, on failure. */
struct lingering *lingering_create(void);
/* Closes what is left. Takes NULL. */
void lingering_destroy(struct lingering *lingering);

/* To be polled for reading. Valid until lingering_destroy. */
int lingering_fd(const struct lingering *lingering);

/* The caller is about to close this socket, and lets it linger under a descriptor of its own here. false: it is closed at once. Any
 * thread. */
bool lingering_take(struct lingering *lingering, int socket);

/* Reads what has come, closes those that have ended or whose time is over. Any thread, one at a time. */
void lingering_work(struct lingering *lingering);

/* Sockets that linger. Any thread. */
size_t lingering_count(struct lingering *lingering);

#endif
