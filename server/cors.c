#include "server/cors.h"

#include "renderer/log.h"
#include "server/response.h"
#include "server/service.h"

#include <stdio.h>
#include <string.h>

static const char separators[] = ", \t";

/* Headers of requests that a page sets beyond those that need no permission. */
#define REQUEST_HEADERS "Authorization, Content-Type, If-Match, If-None-Match, X-Request-Id, X-Timeout-Ms"
/* Headers of answers that a page reads beyond those. */
#define ANSWER_HEADERS                                                                                                                     \
	"Content-Location, ETag, Retry-After, Server-Timing, Stratus-Partial, Stratus-Samples, WWW-Authenticate, X-Request-Id, "           \
	"X-Scene-Key"
/* Seconds for which a browser need not ask again. */
#define PREFLIGHT_AGE "600"

/* As browsers send it (RFC 6454, 6.2): scheme and host in small letters, a port unless it is the scheme's, nothing behind. */
static bool is_origin(const char *text, size_t length)
{
	static const char *const schemes[] = {"https://", "http://"};
	for (size_t i = 0; i < sizeof schemes / sizeof *schemes; i++) {
		const size_t scheme = strlen(schemes[i]);
		if (length > scheme && strncmp(text, schemes[i], scheme) == 0)
			return strspn(text + scheme, "abcdefghijklmnopqrstuvwxyz0123456789.-_:[]") >= length - scheme;
	}
	return false;
}

bool cors_origins_are_valid(const char *origins)
{
	for (const char *c = origins ? origins + strspn(origins, separators) : ""; *c; c += strspn(c, separators)) {
		const size_t length = strcspn(c, separators);
		if (!is_origin(c, length)) {
			log_error("--cors-origins: '%.*s' is no origin such as https://example.org", (int)length, c);
			return false;
		}
		c += length;
	}
	return true;
}

static bool is_named(const char *origins, const char *origin)
{
	const size_t wanted = strlen(origin);
	for (const char *c = origins + strspn(origins, separators); *c; c += strspn(c, separators)) {
		const size_t length = strcspn(c, separators);
		if (length == wanted && strncmp(c, origin, length) == 0)
			return true;
		c += length;
	}
	return false;
}

const char *cors_origin(const struct request *request)
{
	const char *origins = request->service->config->cors_origins, *origin = request_header(request, "Origin");
	return origins && origin && is_named(origins, origin) ? origin : NULL;
}

void cors_allow(const struct request *request, struct MHD_Response *response)
{
	if (!request->service->config->cors_origins)
		return;
	const char *origin = cors_origin(request);
	response_set(response, "Vary", "Origin");
	if (!origin)
		return;
	response_set(response, "Access-Control-Allow-Origin", origin);
	response_set(response, "Access-Control-Expose-Headers", ANSWER_HEADERS);
	response_set(response, "Timing-Allow-Origin", origin);
}

bool cors_answer_preflight(struct request *request, enum MHD_Result *result)
{
	if (strcmp(request->method, MHD_HTTP_METHOD_OPTIONS) != 0 || !request_header(request, "Access-Control-Request-Method") ||
	    !cors_origin(request) || !request->route->allow)
		return false;
	struct MHD_Response *response = MHD_create_response_from_buffer(0, NULL, MHD_RESPMEM_PERSISTENT);
	response_set(response, "Access-Control-Allow-Methods", request->route->allow);
	response_set(response, "Access-Control-Allow-Headers", REQUEST_HEADERS);
	response_set(response, "Access-Control-Max-Age", PREFLIGHT_AGE);
	*result = response_send(request, MHD_HTTP_NO_CONTENT, response);
	return true;
}
