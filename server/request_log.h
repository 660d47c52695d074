/* The log line of a request. */
#ifndef STRATUS_SERVER_REQUEST_LOG_H
#define STRATUS_SERVER_REQUEST_LOG_H

#include "server/request.h"

/* Writes the one line of a request that has ended: id, method, path, status, milliseconds, bytes of the answer's body, the status of an
 * answer that was cut off, key, scene and stages, those that are known of it. Probes and scrapes are lines of level debug. status: as it is
 * counted, 499 when the client left. HTTP thread.
 */
void request_log(const struct request *request, unsigned status, double milliseconds);

#endif
