#include "clients/bench/server_address.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/* Splits HOST, HOST:PORT, [IPV6] or [IPV6]:PORT. false when it is none of them. */
static bool split(char *text, char **host, char **port)
{
	char *end;
	*host = text;
	if (*text == '[') {
		*host = text + 1;
		end = strchr(text, ']');
		if (!end)
			return false;
		*end++ = '\0';
	} else {
		end = text + strcspn(text, ":");
	}
	*port = *end == ':' ? end + 1 : "80";
	const bool whole = !*end || *end == ':';
	*end = '\0';
	return whole && **host && **port;
}

static bool connects(const struct addrinfo *address)
{
	const int trial = socket(address->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
	const bool good = trial >= 0 && connect(trial, address->ai_addr, address->ai_addrlen) == 0;
	if (trial >= 0)
		close(trial);
	return good;
}

int server_address_find(const char *url, struct server_address *address)
{
	static const char scheme[] = "http://";
	const struct addrinfo wanted = {.ai_socktype = SOCK_STREAM};
	char text[288], *host, *port;
	*address = (struct server_address){0};
	const char *rest = strncmp(url, scheme, sizeof scheme - 1) == 0 ? url + sizeof scheme - 1 : NULL;
	const size_t length = rest ? strcspn(rest, "/") : 0;
	if (length == 0 || length >= sizeof text || rest[length + (rest[length] == '/')]) {
		client_error("a load goes to http://HOST[:PORT], not to %s", url);
		return CLIENT_USAGE;
	}
	memcpy(text, rest, length);
	text[length] = '\0';
	snprintf(address->host, sizeof address->host, "%s", text);
	if (!split(text, &host, &port)) {
		client_error("a load goes to http://HOST[:PORT], not to %s", url);
		return CLIENT_USAGE;
	}
	const int error = getaddrinfo(host, port, &wanted, &address->list);
	if (error) {
		client_error("%s: %s", host, gai_strerror(error));
		return CLIENT_UNREACHABLE;
	}
	for (address->found = address->list; address->found && !connects(address->found); address->found = address->found->ai_next)
		;
	if (!address->found)
		client_error("%s: cannot connect: %s", url, strerror(errno));
	return address->found ? CLIENT_OK : CLIENT_UNREACHABLE;
}

void server_address_finish(struct server_address *address)
{
	if (address->list)
		freeaddrinfo(address->list);
	*address = (struct server_address){0};
}
