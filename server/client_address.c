#include "server/client_address.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>

static void ipv6_key(const struct in6_addr *address, char key[static CLIENT_KEY_SIZE])
{
	char text[INET6_ADDRSTRLEN] = "";
	if (IN6_IS_ADDR_V4MAPPED(address)) {
		inet_ntop(AF_INET, address->s6_addr + 12, text, sizeof text);
		snprintf(key, CLIENT_KEY_SIZE, "%s", text);
		return;
	}
	struct in6_addr network = *address;
	memset(network.s6_addr + 8, 0, 8);
	inet_ntop(AF_INET6, &network, text, sizeof text);
	snprintf(key, CLIENT_KEY_SIZE, "%s/64", text);
}

void client_address_key(const struct sockaddr *address, char key[static CLIENT_KEY_SIZE])
{
	char text[INET_ADDRSTRLEN] = "";
	strcpy(key, "local");
	if (address && address->sa_family == AF_INET6) {
		ipv6_key(&((const struct sockaddr_in6 *)address)->sin6_addr, key);
	} else if (address && address->sa_family == AF_INET) {
		inet_ntop(AF_INET, &((const struct sockaddr_in *)address)->sin_addr, text, sizeof text);
		snprintf(key, CLIENT_KEY_SIZE, "%s", text);
	}
}
