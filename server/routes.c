#include "server/routes.h"

#include <string.h>

static const struct route routes[] = {
	{"/v1/render", "GET, HEAD, POST", route_render, ROUTE_RENDER},
	{"/v1/compare", "POST", route_compare, ROUTE_COMPARE},
	{"/v1/optics", "GET, HEAD", route_optics, ROUTE_OPTICS},
	{"/v1/slab", "GET, HEAD", route_slab, ROUTE_SLAB},
	{"/v1/sky", "GET, HEAD", route_sky, ROUTE_SKY},
	{"/v1/sun", "GET, HEAD", route_sun, ROUTE_SUN},
	{"/v1/assets", "GET, HEAD", route_assets, ROUTE_ASSETS},
	{ROUTE_ASSET_PREFIX, "GET, HEAD, PUT, DELETE", route_asset, ROUTE_ASSET},
	{"/v1/presets", "GET, HEAD", route_presets, ROUTE_PRESETS},
	{"/", "GET, HEAD", route_index, ROUTE_INDEX},
	{ROUTE_PAGE_PREFIX, "GET, HEAD", route_page, ROUTE_INDEX},
	{"/openapi.yaml", "GET, HEAD", route_openapi, ROUTE_OPENAPI},
	{"/healthz", "GET, HEAD", route_healthz, ROUTE_HEALTHZ},
	{"/readyz", "GET, HEAD", route_readyz, ROUTE_READYZ},
	{"/metrics", "GET, HEAD", route_metrics, ROUTE_METRICS},
};

/* Without `allow`: every method is as wrong as the path. */
static const struct route unknown = {"unknown", NULL, route_unknown, ROUTE_OTHER};

/* A route that ends with a slash has something below it, the root apart. */
static bool leads_to(const struct route *route, const char *path)
{
	const size_t length = strlen(route->path);
	const bool below = length > 1 && route->path[length - 1] == '/';
	return below ? strncmp(route->path, path, length) == 0 : strcmp(route->path, path) == 0;
}

const struct route *routes_find(const char *path)
{
	for (size_t i = 0; i < sizeof routes / sizeof *routes; i++)
		if (leads_to(&routes[i], path))
			return &routes[i];
	return &unknown;
}
