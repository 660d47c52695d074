/* Pages of other origins (Fetch standard, 3.3): off unless origins are named, and then for those alone. HTTP thread. */
#ifndef STRATUS_SERVER_CORS_H
#define STRATUS_SERVER_CORS_H

#include "server/config.h"
#include "server/request.h"

/* Is it a list of origins, "https://example.org http://localhost:3000"? NULL is an empty one. Neither "*" nor "null" is an origin. false
 * and a log line when not. Main thread. */
bool cors_origins_are_valid(const char *origins);

/* The origin of the page that asks, when that is named; NULL else. */
const char *cors_origin(const struct request *request);

/* Lets the page read the answer and its headers and timings. Says, once any origin is named, that the answer depends on who asks. */
void cors_allow(const struct request *request, struct MHD_Response *response);

/* Answers a browser that asks beforehand whether a page may send a request. false: it is no such question, or not by a named origin. */
bool cors_answer_preflight(struct request *request, enum MHD_Result *result);

#endif
