/* libmicrohttpd's callbacks: requests are made, read, given to their route and freed here. */
#ifndef STRATUS_SERVER_HTTP_H
#define STRATUS_SERVER_HTTP_H

#include "server/service.h"

/* Can this process listen on an address of --listen? Yes, too, when another one does. false and a log line when not. */
bool http_can_listen(const char *listen);

/* Does nobody but this machine reach an address of --listen? Yes, too, when it is none. */
bool http_is_local(const char *listen);

/* Listens on config->listen and starts the HTTP threads; sets service->daemon, host and port. false and a log line on failure. */
bool http_start(struct service *service);

/* Stops listening; connections that exist go on. */
void http_quiesce(struct service *service);

/* Ends the threads and closes every connection. None may be suspended. */
void http_stop(struct service *service);

#endif
