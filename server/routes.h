/* What the service answers, and by which handler. */
#ifndef STRATUS_SERVER_ROUTES_H
#define STRATUS_SERVER_ROUTES_H

#include "server/request.h"

/* What stands before the name of an asset. */
#define ROUTE_ASSET_PREFIX "/v1/assets/"
/* What stands before the files that the page at / is made of. */
#define ROUTE_PAGE_PREFIX "/web/"

/* The route of a path. Never NULL: unknown paths have one that answers 404. */
const struct route *routes_find(const char *path);

request_handler route_render, route_compare, route_optics, route_slab, route_sky, route_sun, route_presets, route_index, route_page,
	route_openapi, route_healthz, route_readyz, route_metrics, route_assets, route_asset, route_unknown;
/* Assets are all that is PUT. The headers of such a request are in (MHD_YES: the body may come), and a piece of its body. */
request_handler route_asset_begin;
enum MHD_Result route_asset_take(struct request *request, const char *data, size_t size);

#endif
