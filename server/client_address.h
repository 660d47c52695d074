/* Whom a request counts for: the key by which clients share the renderer and the connections. */
#ifndef STRATUS_SERVER_CLIENT_ADDRESS_H
#define STRATUS_SERVER_CLIENT_ADDRESS_H

#include <sys/socket.h>

enum { CLIENT_KEY_SIZE = 64 };

/* The key of an address: an IPv4 address itself, of IPv6 the network of 64 bits, since one host may use any address in it; "local" for all
 * else. Ports count for nothing. Any thread. */
void client_address_key(const struct sockaddr *address, char key[static CLIENT_KEY_SIZE]);

#endif
