/* /healthz, /readyz, /metrics: answered at once by the HTTP threads, whatever the render thread does. */
#include "server/routes.h"

#include "server/response.h"
#include "server/service.h"
#include "server/tls.h"

static const char *const state_names[] = {[SERVICE_STARTING] = "starting",
					  [SERVICE_READY] = "ready",
					  [SERVICE_RECOVERING] = "recovering",
					  [SERVICE_STOPPING] = "stopping",
					  [SERVICE_FAILED] = "failed"};

/* Fails only when a restart helps. */
enum MHD_Result route_healthz(struct request *request)
{
	bool failed = service_state(request->service) == SERVICE_FAILED;
	json_t *answer = json_pack("{s:s, s:s}", "status", failed ? "failed" : "ok", "version", RENDERER_VERSION);
	return response_send_json(request, failed ? MHD_HTTP_SERVICE_UNAVAILABLE : MHD_HTTP_OK, answer, CACHE_NONE);
}

enum MHD_Result route_readyz(struct request *request)
{
	static const char *const pass_names[] = {[PASS_AUTO] = "auto", [PASS_FRAGMENT] = "fragment", [PASS_COMPUTE] = "compute"};
	struct service *service = request->service;
	enum service_state state = service_state(service);
	json_t *answer = json_pack("{s:s}", "status", state_names[state]);
	if (state == SERVICE_READY) {
		const struct renderer_info *info = render_thread_info(service->render_thread);
		json_t *details = json_pack("{s:s, s:s, s:s, s:s, s:b, s:s, s:I, s:i}", "vendor", info->vendor, "renderer", info->renderer,
					    "version", info->version, "platform", info->platform, "software", info->software, "pass",
					    pass_names[info->pass_kind], "queue_depth", (json_int_t)service_queue_depth(service),
					    "max_texture_size", info->max_texture_size);
		json_object_update(answer, details);
		json_decref(details);
	}
	return response_send_json(request, state == SERVICE_READY ? MHD_HTTP_OK : MHD_HTTP_SERVICE_UNAVAILABLE, answer, CACHE_NONE);
}

enum MHD_Result route_metrics(struct request *request)
{
	struct service *service = request->service;
	struct metrics_now now = {
		.info = service->ready ? render_thread_info(service->render_thread) : NULL,
		.ready = service_state(service) == SERVICE_READY,
		.queue_depth = service_queue_depth(service),
		.queue_pixels = service_queue_pixels(service),
		.queue_pixels_limit = 1e6 * service->config->queue_mpixels,
		.backlog_ms = render_queue_backlog_ms(service->queue),
		.connections = connections_count(service->connections),
		.connections_limit = connections_total(service->connections),
		.memory_bytes = service->memory_bytes,
		.memory_limit = (size_t)service->config->memory_mb << 20,
		.intake = intake_look(service->intake),
		.requests_in_flight = service->in_flight,
		.keys = service->keys,
		.certificate_expiry = tls_expiry(),
		.tracings_waiting = worker_pool_waiting(service->tracers),
		.tracings_limit = SERVICE_TRACINGS_MAX,
		.cache_limit = (size_t)service->config->cache_mb << 20,
	};
	now.finished = image_cache_counts(service->finished);
	asset_store_usage(service->assets, &now.assets, &now.asset_bytes);
	now.asset_map_bytes = asset_maps_bytes(service->maps);
	for (int stage = 0; stage < STAGE_COUNT && service->ready; stage++)
		now.cache_bytes[stage] = render_thread_cache_bytes(service->render_thread, (enum stage)stage);
	if (service->ready)
		now.care = render_thread_care(service->render_thread);
	if (service->ready)
		now.droplets = droplet_store_counts(render_thread_droplets(service->render_thread));
	return response_send_document(request, metrics_format(service->metrics, &now),
				      "application/openmetrics-text; version=1.0.0; charset=utf-8", CACHE_NONE);
}
