/* The HTTP service: libmicrohttpd's threads, the render thread, the workers, and what the routes share. */
#ifndef STRATUS_SERVER_SERVICE_H
#define STRATUS_SERVER_SERVICE_H

#include "renderer/image/image.h"
#include "server/api_keys.h"
#include "server/asset_maps.h"
#include "server/config.h"
#include "server/connections.h"
#include "server/cost_model.h"
#include "server/decoder.h"
#include "server/encoder_care.h"
#include "server/flight.h"
#include "server/intake.h"
#include "server/metrics.h"
#include "server/preparation.h"
#include "server/render_queue.h"
#include "server/render_thread.h"
#include "server/worker_pool.h"

#include <stdatomic.h>

enum service_state {
	SERVICE_STARTING,
	SERVICE_READY,
	SERVICE_RECOVERING, /* takes work, which waits for the renderer to be made anew, or fails since no picture can be written */
	SERVICE_STOPPING,   /* finishing what was accepted */
	SERVICE_FAILED      /* a restart is needed */
};

/* Photon tracings that may wait for the one that runs; of one client half of them (shares.h). */
enum { SERVICE_TRACINGS_MAX = 8 };

struct MHD_Daemon;

/* Read by the routes; what is not atomic does not change from the moment `ready` is true. */
struct service {
	const struct config *config;
	struct connections *connections;
	struct cost_model *costs;
	struct metrics *metrics;
	struct intake *intake; /* places of all that is accepted */
	struct render_queue *queue;
	struct render_thread *_Atomic render_thread;
	struct preparation *preparation; /* once ready */
	struct worker_pool *workers;     /* encode images: the render thread waits for them, so nothing slow runs here */
	struct worker_pool *computers;   /* droplets and layers for their own calls, behind the pictures */
	struct worker_pool *tracers;     /* one thread that traces photons, on all processors, behind everything else */
	struct worker_pool *decoders;    /* one thread that has uploaded pictures read, one at a time since each takes memory */
	struct api_keys *keys;
	struct image_cache *finished; /* images, to be answered again */
	struct flights *flights;      /* renders that several requests may wait for */
	struct asset_store *assets;
	struct asset_maps *maps;
	struct decoder *decoder;
	struct MHD_Daemon *daemon;
	const struct image_api *images;
	char *pixel_version; /* everything but the question and the device that decides about an answer's bytes */
	char host[256];      /* listening address as a URL says it */
	unsigned port;
	int listening_socket; /* taken from libmicrohttpd while stopping; else negative */

	struct encoder_care encoders; /* whether they can write pictures */
	unsigned long wrong_seen;     /* golden renders that failed; of the connections' thread */
	_Atomic size_t in_flight;     /* requests read to their end and not answered to theirs */
	_Atomic size_t memory_bytes;  /* promised to pictures in work, and of their answers (admission.h) */
	_Atomic size_t suspended;     /* those of them that others work for */
	_Atomic double tracing_ms;    /* what the last tracing took */
	_Atomic double computing_ms;  /* what the last call did that computers worked for */
	_Atomic bool ready;           /* has been ready to render */
	_Atomic bool stopping;        /* takes no new work */
	_Atomic bool abandoned;       /* since there is no renderer any more */
	_Atomic bool giving_up;       /* drops the accepted work too, since the time for it is over */
};

/* Starts serving; rendering comes up behind. NULL (and a log line) on failure, such as an address in use. Main thread. */
struct service *service_create(const struct config *config);

/* Waits until the service can render, at most so long. SERVICE_STARTING: not yet. Main thread. */
enum service_state service_wait(struct service *service, int milliseconds);

/* Takes no new work, finishes what was accepted, within --drain-s, and refuses the rest of it; stops all threads, frees everything. Takes
 * NULL. Main thread. */
void service_destroy(struct service *service);

/* The renderer hangs or cannot be had any more: answers what can be answered without it, for at most some seconds. Nothing is freed, and
 * the process is to end. Main thread. */
void service_abandon(struct service *service);

/* Reads keys and certificate again; what cannot be used leaves the old ones in force. false then, with lines of the log. Main thread. */
bool service_reload(struct service *service);

/* Any thread. */
enum service_state service_state(const struct service *service);

/* Renders waiting for their droplets or for the renderer. Any thread. */
size_t service_queue_depth(const struct service *service);
double service_queue_pixels(const struct service *service);

/* A guess at when there is room again for photon tracings, and for calls that compute droplets and layers, from 1. Any thread. */
unsigned service_tracing_retry_seconds(const struct service *service);
unsigned service_computing_retry_seconds(const struct service *service);

/* States why the service takes no work at present and counts it. false when it does take work. HTTP thread. */
struct request;
bool service_refuses(struct request *request);

#endif
