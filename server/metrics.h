/* Counters and histograms for /metrics, as OpenMetrics text. Any thread.
 *
 * Labels are bounded by construction: routes, statuses, stages and reasons are enumerations, keys those of the file of keys; never text of
 * a request.
 */
#ifndef STRATUS_SERVER_METRICS_H
#define STRATUS_SERVER_METRICS_H

#include "renderer/droplet_store.h"
#include "server/api_keys.h"
#include "server/connections.h"
#include "server/image_cache.h"
#include "server/problem.h"
#include "server/intake.h"
#include "server/render_queue.h"
#include "server/renderer_care.h"
#include "server/server_timing.h"

#include <time.h>

enum metrics_route {
	ROUTE_RENDER,
	ROUTE_COMPARE,
	ROUTE_OPTICS,
	ROUTE_SLAB,
	ROUTE_SKY,
	ROUTE_SUN,
	ROUTE_ASSETS,
	ROUTE_ASSET,
	ROUTE_PRESETS,
	ROUTE_INDEX,
	ROUTE_OPENAPI,
	ROUTE_HEALTHZ,
	ROUTE_READYZ,
	ROUTE_METRICS,
	ROUTE_OTHER,
	ROUTE_COUNT
};

enum metrics_rejection {
	REJECTED_FULL,
	REJECTED_PIXELS,
	REJECTED_LATE,
	REJECTED_MEMORY,
	REJECTED_CONNECTIONS,
	REJECTED_STARTING,
	REJECTED_SHUTTING_DOWN,
	REJECTED_UNAVAILABLE,
	REJECTION_COUNT
};
/* Where the image of an answer came from. */
enum metrics_image { IMAGE_FROM_CACHE, IMAGE_SHARED, IMAGE_MISSED, IMAGE_BYPASSED, IMAGE_SOURCE_COUNT };
enum metrics_end { ENDED_EXPIRED, ENDED_ABANDONED, ENDED_FAILED, ENDED_STOPPED, END_COUNT };

struct metrics;

struct metrics *metrics_create(void);
void metrics_destroy(struct metrics *metrics);

/* status: of HTTP; 499 when the client left before the answer was whole. bytes: of the answer's body, those that were delivered. */
void metrics_count_request(struct metrics *metrics, enum metrics_route route, unsigned status, double milliseconds, uint64_t bytes);
/* An answer that is a problem. */
void metrics_count_problem(struct metrics *metrics, enum problem_kind kind);
/* A picture that was answered, layers counted apart. */
void metrics_count_picture(struct metrics *metrics, double pixels);
/* The stages of an answered render. Stages taken from memory are counted apart: their zeros would hide what the work costs. */
void metrics_count_timings(struct metrics *metrics, const struct timings *timings);
/* A request for an image that was not answered without one. */
void metrics_count_image(struct metrics *metrics, enum metrics_image source);
void metrics_count_rejection(struct metrics *metrics, enum metrics_rejection reason);
/* Requests that were accepted and got no picture; and what the render thread spent on renders that brought none. */
void metrics_count_end(struct metrics *metrics, enum metrics_end end);
void metrics_count_waste(struct metrics *metrics, enum metrics_end end, double spent_ms);
/* Those of them that nobody waited for any more, by how far they came; and what a render took over what was predicted. */
void metrics_count_cancellation(struct metrics *metrics, enum render_phase at);
void metrics_count_prediction(struct metrics *metrics, double ratio);
/* Photons traced to their end, and tracings that were accepted and brought no numbers. */
void metrics_count_photons(struct metrics *metrics, double photons);
void metrics_count_tracing_end(struct metrics *metrics, enum metrics_end end);

/* What is asked for at the moment of the scrape. info NULL: not ready yet. */
struct metrics_now {
	const struct renderer_info *info;
	bool ready; /* as /readyz says it */
	size_t queue_depth, requests_in_flight;
	struct intake_now intake;
	double queue_pixels, queue_pixels_limit, backlog_ms;
	struct connections_counts connections;
	struct care_counts care;
	size_t connections_limit, memory_bytes, memory_limit;
	size_t tracings_waiting, tracings_limit;
	struct droplet_store_counts droplets;
	struct api_keys *keys;
	time_t certificate_expiry; /* 0: there is none */
	struct image_cache_counts finished;
	size_t assets;
	uint64_t asset_bytes, asset_map_bytes;        /* on disk; decoded, in memory */
	size_t cache_bytes[STAGE_COUNT], cache_limit; /* on the GPU */
};

/* The caller frees; NULL when out of memory. */
char *metrics_format(struct metrics *metrics, const struct metrics_now *now);

#endif
