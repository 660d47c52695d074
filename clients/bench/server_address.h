/* Where a load goes: the daemon's URL as an address of a socket. */
#ifndef STRATUS_CLIENTS_BENCH_SERVER_ADDRESS_H
#define STRATUS_CLIENTS_BENCH_SERVER_ADDRESS_H

#include "clients/client.h"

#include <netdb.h>

struct server_address {
	struct addrinfo *list, *found; /* all addresses, and the one that answers */
	char host[288];                /* as the Host header says it */
};

/* Of http://HOST[:PORT] alone: a load goes without TLS. An enum client_exit, after a message when not CLIENT_OK. server_address_finish in
 * either case. */
int server_address_find(const char *url, struct server_address *address);
void server_address_finish(struct server_address *address);

#endif
