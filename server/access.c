#include "server/access.h"

#include "renderer/log.h"
#include "server/api_keys.h"
#include "server/http.h"
#include "server/response.h"
#include "server/service.h"

#include <math.h>
#include <string.h>
#include <strings.h>

static bool needs_key(const struct service *service, const struct route *route)
{
	switch (route->metrics) {
	case ROUTE_INDEX:
	case ROUTE_OPENAPI:
	case ROUTE_HEALTHZ:
	case ROUTE_READYZ:
	case ROUTE_OTHER:
		return false;
	case ROUTE_METRICS:
		return !service->config->open_metrics;
	default:
		return true;
	}
}

/* The key in `Authorization: Bearer KEY`, the scheme in any case (RFC 9110, 11.1); NULL: there is none. */
static const char *shown_key(const struct request *request)
{
	static const char scheme[] = "Bearer";
	const char *header = request_header(request, "Authorization");
	if (!header || strncasecmp(header, scheme, sizeof scheme - 1) != 0 || header[sizeof scheme - 1] != ' ')
		return NULL;
	header += sizeof scheme - 1;
	return header + strspn(header, " ");
}

static bool refuse_for_now(struct request *request, double wait_ms, const char *what, enum MHD_Result *result)
{
	request->retry_after_s = (unsigned)fmin(ceil(wait_ms * 1e-3), 86400);
	*result = response_send_new_problem(request, PROBLEM_ALLOWANCE, "The key %s has used up its %s a minute.", request->key, what);
	return false;
}

bool access_admit(struct request *request, enum MHD_Result *result)
{
	struct api_keys *keys = request->service->keys;
	if (!api_keys_are_asked_for(keys) || !needs_key(request->service, request->route))
		return true;
	const char *shown = shown_key(request);
	if (!shown) {
		*result = response_send_new_problem(request, PROBLEM_NO_KEY, "A key is needed here, as Authorization: Bearer KEY.");
		return false;
	}
	if (!api_keys_find(keys, shown, request->key)) {
		*result = response_send_new_problem(request, PROBLEM_BAD_KEY, "That is no key of this service.");
		return false;
	}
	request->client = request->key; /* a key's time is shared by all who show it, from wherever */
	const double wait_ms = api_keys_take(keys, request->key, KEY_LIMIT_REQUESTS, 1);
	return wait_ms > 0 ? refuse_for_now(request, wait_ms, "requests", result) : true;
}

bool access_admit_pixels(struct request *request, double pixels, enum MHD_Result *result)
{
	const double wait_ms = api_keys_take(request->service->keys, request->key, KEY_LIMIT_MEGAPIXELS, pixels * 1e-6);
	if (wait_ms > 0)
		return refuse_for_now(request, wait_ms, "megapixels", result);
	request->admitted_pixels = pixels;
	return true;
}

void access_return_pixels(struct request *request)
{
	api_keys_give_back(request->service->keys, request->key, KEY_LIMIT_MEGAPIXELS, request->admitted_pixels * 1e-6);
	request->admitted_pixels = 0;
}

void access_end(struct request *request, unsigned status)
{
	struct api_keys *keys = request->service->keys;
	if (status == MHD_HTTP_SERVICE_UNAVAILABLE)
		api_keys_give_back(keys, request->key, KEY_LIMIT_MEGAPIXELS, request->admitted_pixels * 1e-6);
	api_keys_count(keys, request->key, status == MHD_HTTP_OK ? request->admitted_pixels : 0);
}

bool access_settings_are_safe(const struct config *config)
{
	if (http_is_local(config->listen))
		return true;
	if (!config->keys && !config->allow_anyone) {
		log_error("--listen %s: others than this machine reach it, and without --keys all of them may use it: --allow-anyone if "
			  "they may",
			  config->listen);
		return false;
	}
	if (!config->keys)
		log_warning("--listen %s: whoever reaches it may use it (--allow-anyone)", config->listen);
	else if (!config->tls_cert)
		log_warning("--listen %s: keys and pictures travel in the clear; --tls-cert, or a proxy in front, keeps them private",
			    config->listen);
	return true;
}
