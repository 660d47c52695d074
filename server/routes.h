/* What the service answers, and by which handler. */
#ifndef STRATUS_SERVER_ROUTES_H
#define STRATUS_SERVER_ROUTES_H

#include "server/request.h"

/* The route of a path. Never NULL: unknown paths have one that answers 404. */
const struct route *routes_find(const char *path);

request_handler route_render, route_optics, route_slab, route_sky, route_sun, route_presets, route_index, route_openapi, route_healthz,
	route_readyz, route_metrics, route_later, route_unknown;

#endif
