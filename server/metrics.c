#include "server/metrics.h"

#include "renderer/log.h"
#include "server/process_memory.h"
#include "server/text.h"

#include <dirent.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

static const char *const route_names[ROUTE_COUNT] = {"/v1/render",    "/v1/compare", "/v1/optics",      "/v1/slab",    "/v1/sky",
						     "/v1/sun",       "/v1/assets",  "/v1/assets/NAME", "/v1/presets", "/",
						     "/openapi.yaml", "/healthz",    "/readyz",         "/metrics",    "other"};
static const char *const rejection_names[REJECTION_COUNT] = {"full",        "pixels",   "predicted_late", "memory",
							     "connections", "starting", "shutting_down",  "unavailable"};
static const char *const image_names[IMAGE_SOURCE_COUNT] = {
	[IMAGE_FROM_CACHE] = "hit", [IMAGE_SHARED] = "shared", [IMAGE_MISSED] = "miss", [IMAGE_BYPASSED] = "bypass"};
static const char *const end_names[END_COUNT] = {"expired", "abandoned", "failed", "stopped"};
static const char *const phase_names[RENDER_PHASE_COUNT] = {
	[RENDER_PHASE_QUEUED] = "queued", [RENDER_PHASE_RENDERING] = "rendering", [RENDER_PHASE_ENCODING] = "encoding"};
static const char *const source_names[DROPLET_SOURCE_COUNT] = {
	[DROPLETS_FROM_MEMORY] = "memory", [DROPLETS_FROM_DISK] = "disk", [DROPLETS_COMPUTED] = "computed"};

/* Every status that is sent; the last stands for all others. */
static const unsigned statuses[] = {200, 201, 204, 304, 400, 401, 404, 405, 406, 408, 412, 413,
				    414, 415, 422, 429, 431, 499, 500, 503, 504, 505, 507, 0};
enum { STATUS_COUNT = sizeof statuses / sizeof *statuses };

enum { BOUND_COUNT = 16 };
/* Upper bounds in seconds: half a millisecond to a minute. */
static const double time_bounds[BOUND_COUNT] = {0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60};
/* In pixels: thumbnails to a quarter of the largest picture. */
static const double pixel_bounds[BOUND_COUNT] = {1e3, 2e3, 5e3, 1e4, 2e4, 5e4, 1e5, 2e5, 5e5, 1e6, 2e6, 4e6, 8e6, 16e6, 32e6, 64e6};

/* Of a measured time to its prediction. */
static const double ratio_bounds[BOUND_COUNT] = {0.1, 0.2, 0.33, 0.5, 0.67, 0.8, 0.9, 1, 1.1, 1.25, 1.5, 2, 3, 5, 10, 20};

struct histogram {
	unsigned long buckets[BOUND_COUNT + 1];
	unsigned long count;
	double sum;
};

struct metrics {
	pthread_mutex_t mutex;
	struct histogram requests[ROUTE_COUNT][STATUS_COUNT];
	uint64_t bytes[ROUTE_COUNT];
	unsigned long problems[PROBLEM_KIND_COUNT];
	struct histogram stages[TIMING_COUNT];
	struct histogram pictures; /* by pixels */
	unsigned long reused[TIMING_COUNT];
	unsigned long images[IMAGE_SOURCE_COUNT];
	unsigned long rejected[REJECTION_COUNT];
	unsigned long ended[END_COUNT];
	unsigned long cancelled[RENDER_PHASE_COUNT];
	double wasted_ms[END_COUNT];
	struct histogram predictions;
	unsigned long tracings_ended[END_COUNT];
	double photons;
	double started_s; /* Unix time */
};

struct metrics *metrics_create(void)
{
	struct metrics *metrics = calloc(1, sizeof *metrics);
	if (!metrics) {
		log_error("metrics_create: out of memory");
		return NULL;
	}
	pthread_mutex_init(&metrics->mutex, NULL);
	metrics->started_s = (double)time(NULL);
	return metrics;
}

void metrics_destroy(struct metrics *metrics)
{
	if (!metrics)
		return;
	pthread_mutex_destroy(&metrics->mutex);
	free(metrics);
}

static void observe(struct histogram *histogram, const double bounds[static BOUND_COUNT], double value)
{
	int i = 0;
	while (i < BOUND_COUNT && value > bounds[i])
		i++;
	histogram->buckets[i]++;
	histogram->count++;
	histogram->sum += value;
}

void metrics_count_request(struct metrics *metrics, enum metrics_route route, unsigned status, double milliseconds, uint64_t bytes)
{
	int i = 0;
	while (i < STATUS_COUNT - 1 && statuses[i] != status)
		i++;
	pthread_mutex_lock(&metrics->mutex);
	observe(&metrics->requests[route][i], time_bounds, milliseconds * 1e-3);
	metrics->bytes[route] += bytes;
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_problem(struct metrics *metrics, enum problem_kind kind)
{
	pthread_mutex_lock(&metrics->mutex);
	metrics->problems[kind]++;
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_picture(struct metrics *metrics, double pixels)
{
	pthread_mutex_lock(&metrics->mutex);
	observe(&metrics->pictures, pixel_bounds, pixels);
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_timings(struct metrics *metrics, const struct timings *timings)
{
	pthread_mutex_lock(&metrics->mutex);
	for (int i = 0; i < TIMING_COUNT; i++) {
		if (timings->entry[i].reused)
			metrics->reused[i]++;
		else if (timings->entry[i].measured)
			observe(&metrics->stages[i], time_bounds, timings->entry[i].milliseconds * 1e-3);
	}
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_image(struct metrics *metrics, enum metrics_image source)
{
	pthread_mutex_lock(&metrics->mutex);
	metrics->images[source]++;
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_rejection(struct metrics *metrics, enum metrics_rejection reason)
{
	pthread_mutex_lock(&metrics->mutex);
	metrics->rejected[reason]++;
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_end(struct metrics *metrics, enum metrics_end end)
{
	pthread_mutex_lock(&metrics->mutex);
	metrics->ended[end]++;
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_waste(struct metrics *metrics, enum metrics_end end, double spent_ms)
{
	pthread_mutex_lock(&metrics->mutex);
	metrics->wasted_ms[end] += spent_ms;
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_cancellation(struct metrics *metrics, enum render_phase at)
{
	pthread_mutex_lock(&metrics->mutex);
	metrics->cancelled[at]++;
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_prediction(struct metrics *metrics, double ratio)
{
	pthread_mutex_lock(&metrics->mutex);
	observe(&metrics->predictions, ratio_bounds, ratio);
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_photons(struct metrics *metrics, double photons)
{
	pthread_mutex_lock(&metrics->mutex);
	metrics->photons += photons;
	pthread_mutex_unlock(&metrics->mutex);
}

void metrics_count_tracing_end(struct metrics *metrics, enum metrics_end end)
{
	pthread_mutex_lock(&metrics->mutex);
	metrics->tracings_ended[end]++;
	pthread_mutex_unlock(&metrics->mutex);
}

static void write_family(struct text *text, const char *name, const char *type, const char *help)
{
	text_printf(text, "# TYPE stratus_%s %s\n# HELP stratus_%s %s\n", name, type, name, help);
}

/* A whole number has a point, as OpenMetrics writes the bounds of buckets: else two scrapers may take one series for two. */
static void format_bound(double bound, char text[static 32])
{
	snprintf(text, 32, "%g", bound);
	if (!strpbrk(text, ".e"))
		strcat(text, ".0");
}

/* labels: without braces; may be empty. */
static void write_histogram(struct text *text, const char *name, const char *labels, const struct histogram *histogram,
			    const double bounds[static BOUND_COUNT])
{
	const char *comma = *labels ? "," : "", *open = *labels ? "{" : "", *close = *labels ? "}" : "";
	unsigned long total = 0;
	for (int i = 0; i < BOUND_COUNT; i++) {
		char bound[32];
		format_bound(bounds[i], bound);
		total += histogram->buckets[i];
		text_printf(text, "stratus_%s_bucket{%s%sle=\"%s\"} %lu\n", name, labels, comma, bound, total);
	}
	text_printf(text, "stratus_%s_bucket{%s%sle=\"+Inf\"} %lu\n", name, labels, comma, histogram->count);
	text_printf(text, "stratus_%s_count%s%s%s %lu\n", name, open, labels, close, histogram->count);
	text_printf(text, "stratus_%s_sum%s%s%s %.6f\n", name, open, labels, close, histogram->sum);
}

static void request_labels(int route, int status, char *labels, size_t size)
{
	if (statuses[status])
		snprintf(labels, size, "route=\"%s\",status=\"%u\"", route_names[route], statuses[status]);
	else
		snprintf(labels, size, "route=\"%s\",status=\"other\"", route_names[route]);
}

static void write_requests(struct text *text, const struct metrics *metrics)
{
	char labels[128];
	write_family(text, "requests", "counter", "Requests by route and HTTP status; 499: the client left.");
	for (int route = 0; route < ROUTE_COUNT; route++)
		for (int status = 0; status < STATUS_COUNT; status++) {
			request_labels(route, status, labels, sizeof labels);
			if (metrics->requests[route][status].count)
				text_printf(text, "stratus_requests_total{%s} %lu\n", labels, metrics->requests[route][status].count);
		}
	write_family(text, "request_duration_seconds", "histogram", "From the request line to the last byte of the answer.");
	for (int route = 0; route < ROUTE_COUNT; route++)
		for (int status = 0; status < STATUS_COUNT; status++) {
			request_labels(route, status, labels, sizeof labels);
			if (metrics->requests[route][status].count)
				write_histogram(text, "request_duration_seconds", labels, &metrics->requests[route][status], time_bounds);
		}
}

static void write_answers(struct text *text, const struct metrics *metrics)
{
	write_family(text, "response_bytes", "counter", "Bytes of the bodies of answers, those that were delivered, by route.");
	for (int route = 0; route < ROUTE_COUNT; route++)
		text_printf(text, "stratus_response_bytes_total{route=\"%s\"} %llu\n", route_names[route],
			    (unsigned long long)metrics->bytes[route]);
	write_family(text, "problems", "counter", "Answers that are problems, by the end of their type.");
	for (int kind = PROBLEM_NONE + 1; kind < PROBLEM_KIND_COUNT; kind++) {
		unsigned long count = 0;
		bool named = false; /* kinds may share a name: then the first of them has the sum */
		for (int other = PROBLEM_NONE + 1; other < PROBLEM_KIND_COUNT; other++) {
			const bool same = strcmp(problem_name((enum problem_kind)other), problem_name((enum problem_kind)kind)) == 0;
			named |= same && other < kind;
			count += same ? metrics->problems[other] : 0;
		}
		if (!named)
			text_printf(text, "stratus_problems_total{type=\"%s\"} %lu\n", problem_name((enum problem_kind)kind), count);
	}
	write_family(text, "picture_pixels", "histogram", "Pixels of the pictures that were answered, layers counted apart.");
	write_histogram(text, "picture_pixels", "", &metrics->pictures, pixel_bounds);
}

static void write_stages(struct text *text, const struct metrics *metrics)
{
	char labels[64];
	write_family(text, "stage_duration_seconds", "histogram", "Work of the stages of a render, those taken from memory left out.");
	for (int i = 0; i < TIMING_COUNT; i++) {
		snprintf(labels, sizeof labels, "stage=\"%s\"", timing_names[i]);
		write_histogram(text, "stage_duration_seconds", labels, &metrics->stages[i], time_bounds);
	}
	write_family(text, "stage_reused", "counter", "Stages of a render that were taken from memory.");
	for (int i = 0; i < TIMING_COUNT; i++)
		text_printf(text, "stratus_stage_reused_total{stage=\"%s\"} %lu\n", timing_names[i], metrics->reused[i]);
}

static void write_queue(struct text *text, const struct metrics *metrics, const struct metrics_now *now)
{
	write_family(text, "ready", "gauge", "1: renders are taken, as /readyz says it.");
	text_printf(text, "stratus_ready %d\n", now->ready);
	write_family(text, "queue_depth", "gauge", "Renders waiting, for their droplets or for the renderer.");
	text_printf(text, "stratus_queue_depth %zu\n", now->queue_depth);
	write_family(text, "queue_pixels", "gauge", "Pixels of those renders, layers counted apart.");
	text_printf(text, "stratus_queue_pixels %.0f\n", now->queue_pixels);
	write_family(text, "queue_taken", "gauge", "Pictures accepted and not answered yet, whatever they wait for.");
	text_printf(text, "stratus_queue_taken %zu\n", now->intake.taken);
	write_family(text, "queue_limit", "gauge", "Pictures that may be accepted and not answered yet.");
	text_printf(text, "stratus_queue_limit %zu\n", now->intake.places);
	write_family(text, "queue_service_seconds", "gauge",
		     "From one answer to the next while there was enough to do, of late; 0: not measured.");
	text_printf(text, "stratus_queue_service_seconds %.6f\n", now->intake.service_ms * 1e-3);
	write_family(text, "queue_margin", "gauge",
		     "Service times by which answers may take longer than what was predicted to be done before them.");
	text_printf(text, "stratus_queue_margin %.3f\n", now->intake.margin);
	write_family(text, "requests_in_flight", "gauge", "Requests being answered, this one included.");
	text_printf(text, "stratus_requests_in_flight %zu\n", now->requests_in_flight);
	write_family(text, "queue_rejected", "counter", "Work refused, by reason.");
	for (int i = 0; i < REJECTION_COUNT; i++)
		text_printf(text, "stratus_queue_rejected_total{reason=\"%s\"} %lu\n", rejection_names[i], metrics->rejected[i]);
	write_family(text, "renders_ended", "counter", "Accepted renders that brought no picture, by reason.");
	for (int i = 0; i < END_COUNT; i++)
		text_printf(text, "stratus_renders_ended_total{reason=\"%s\"} %lu\n", end_names[i], metrics->ended[i]);
	write_family(text, "wasted_render_seconds", "counter", "Time of the renderer and of encoders on those, by reason.");
	for (int i = 0; i < END_COUNT; i++)
		text_printf(text, "stratus_wasted_render_seconds_total{reason=\"%s\"} %.3f\n", end_names[i], metrics->wasted_ms[i] * 1e-3);
	write_family(text, "cancelled", "counter", "Those of them that nobody waited for any more, by how far they had come.");
	for (int i = 0; i < RENDER_PHASE_COUNT; i++)
		text_printf(text, "stratus_cancelled_total{at=\"%s\"} %lu\n", phase_names[i], metrics->cancelled[i]);
}

static void write_admission(struct text *text, const struct metrics *metrics, const struct metrics_now *now)
{
	write_family(text, "queue_backlog_seconds", "gauge", "Time that renders will take that wait or run, as predicted.");
	text_printf(text, "stratus_queue_backlog_seconds %.3f\n", now->backlog_ms * 1e-3);
	write_family(text, "queue_pixels_limit", "gauge", "Pixels of renders that may wait for each.");
	text_printf(text, "stratus_queue_pixels_limit %.0f\n", now->queue_pixels_limit);
	write_family(text, "render_prediction_ratio", "histogram", "Time that a render took over what was predicted.");
	write_histogram(text, "render_prediction_ratio", "", &metrics->predictions, ratio_bounds);
	write_family(text, "picture_memory_bytes", "gauge", "Memory promised to pictures in work.");
	text_printf(text, "stratus_picture_memory_bytes %zu\n", now->memory_bytes);
	write_family(text, "picture_memory_limit_bytes", "gauge", "Memory that may be promised.");
	text_printf(text, "stratus_picture_memory_limit_bytes %zu\n", now->memory_limit);
	write_family(text, "connections", "gauge", "Open connections.");
	text_printf(text, "stratus_connections %zu\n", now->connections.open);
	write_family(text, "connections_limit", "gauge", "Connections that may be open for more than probes and metrics.");
	text_printf(text, "stratus_connections_limit %zu\n", now->connections_limit);
	write_family(text, "connections_dropped", "counter",
		     "Connections closed at once, served probes alone, or closed for their slowness.");
	text_printf(text, "stratus_connections_dropped_total{reason=\"refused\"} %llu\n", now->connections.refused);
	text_printf(text, "stratus_connections_dropped_total{reason=\"surplus\"} %llu\n", now->connections.surplus);
	text_printf(text, "stratus_connections_dropped_total{reason=\"slow\"} %llu\n", now->connections.slow);
}

static void write_care(struct text *text, const struct care_counts *care)
{
	write_family(text, "gl_context_resets", "counter", "Times that the renderer was made anew, by reason.");
	for (int i = CARE_NONE + 1; i < CARE_REASON_COUNT; i++)
		text_printf(text, "stratus_gl_context_resets_total{reason=\"%s\"} %lu\n", care_reason_names[i], care->resets[i]);
	write_family(text, "renders_repeated", "counter", "Renders begun again, since the context was lost in the middle.");
	text_printf(text, "stratus_renders_repeated_total %lu\n", care->repeated);
	write_family(text, "golden_renders", "counter", "Golden renders, by what came of them.");
	text_printf(text, "stratus_golden_renders_total{result=\"passed\"} %lu\n", care->golden_passed);
	text_printf(text, "stratus_golden_renders_total{result=\"failed\"} %lu\n", care->golden_failed);
}

static void write_tracings(struct text *text, const struct metrics *metrics, const struct metrics_now *now)
{
	write_family(text, "tracings_waiting", "gauge", "Photon tracings waiting.");
	text_printf(text, "stratus_tracings_waiting %zu\n", now->tracings_waiting);
	write_family(text, "tracings_limit", "gauge", "Photon tracings that may wait.");
	text_printf(text, "stratus_tracings_limit %zu\n", now->tracings_limit);
	write_family(text, "photons", "counter", "Photons traced for answers, the bands together.");
	text_printf(text, "stratus_photons_total %.0f\n", metrics->photons);
	write_family(text, "tracings_ended", "counter", "Accepted photon tracings that brought no numbers, by reason.");
	for (int i = 0; i < END_COUNT; i++)
		text_printf(text, "stratus_tracings_ended_total{reason=\"%s\"} %lu\n", end_names[i], metrics->tracings_ended[i]);
}

static void write_droplets(struct text *text, const struct droplet_store_counts *counts)
{
	write_family(text, "droplet_tables", "counter", "Uses of the tables of a droplet distribution, by where they came from.");
	for (int i = 0; i < DROPLET_SOURCE_COUNT; i++)
		text_printf(text, "stratus_droplet_tables_total{source=\"%s\"} %llu\n", source_names[i],
			    (unsigned long long)counts->from[i]);
	write_family(text, "droplet_files_damaged", "counter", "Files of such tables that were damaged or foreign, and computed anew.");
	text_printf(text, "stratus_droplet_files_damaged_total %llu\n", (unsigned long long)counts->damaged_files);
	write_family(text, "droplet_tables_bytes", "gauge", "Memory of such tables.");
	text_printf(text, "stratus_droplet_tables_bytes %llu\n", (unsigned long long)counts->memory_bytes);
}

static void write_assets(struct text *text, const struct metrics_now *now)
{
	write_family(text, "assets", "gauge", "Uploaded pictures.");
	text_printf(text, "stratus_assets %zu\n", now->assets);
	write_family(text, "assets_bytes", "gauge", "Disk space of uploaded pictures.");
	text_printf(text, "stratus_assets_bytes %llu\n", (unsigned long long)now->asset_bytes);
	write_family(text, "asset_maps_bytes", "gauge", "Memory of decoded pictures.");
	text_printf(text, "stratus_asset_maps_bytes %llu\n", (unsigned long long)now->asset_map_bytes);
}

/* Where one family ends another begins, so each asks for all keys. */
struct key_writer {
	struct text *text;
	enum { KEY_REQUESTS, KEY_REFUSED, KEY_PIXELS } family;
};

static void write_key(void *context, const char *name, const struct api_key_counts *counts)
{
	static const char *const limits[KEY_LIMIT_COUNT] = {[KEY_LIMIT_REQUESTS] = "requests", [KEY_LIMIT_MEGAPIXELS] = "megapixels"};
	const struct key_writer *writer = context;
	switch (writer->family) {
	case KEY_REQUESTS:
		text_printf(writer->text, "stratus_key_requests_total{key=\"%s\"} %lu\n", name, counts->requests);
		break;
	case KEY_REFUSED:
		for (int i = 0; i < KEY_LIMIT_COUNT; i++)
			text_printf(writer->text, "stratus_key_refused_total{key=\"%s\",limit=\"%s\"} %lu\n", name, limits[i],
				    counts->refused[i]);
		break;
	case KEY_PIXELS:
		text_printf(writer->text, "stratus_key_pixels_total{key=\"%s\"} %.0f\n", name, counts->pixels);
		break;
	}
}

static void write_keys(struct text *text, const struct metrics_now *now)
{
	write_family(text, "key_requests", "counter", "Answers by the name of the key that the request showed; anonymous: none.");
	api_keys_visit(now->keys, write_key, &(struct key_writer){text, KEY_REQUESTS});
	write_family(text, "key_refused", "counter", "Requests refused since the key had used up what it may have a minute.");
	api_keys_visit(now->keys, write_key, &(struct key_writer){text, KEY_REFUSED});
	write_family(text, "key_pixels", "counter", "Pixels of pictures that were answered, layers counted apart, by key.");
	api_keys_visit(now->keys, write_key, &(struct key_writer){text, KEY_PIXELS});
	write_family(text, "certificate_expiry_seconds", "gauge", "Unix time at which the certificate ends; 0: there is none.");
	text_printf(text, "stratus_certificate_expiry_seconds %lld\n", (long long)now->certificate_expiry);
}

static void write_images(struct text *text, const struct metrics *metrics, const struct image_cache_counts *finished)
{
	write_family(text, "image_requests", "counter",
		     "Requests for images, by what the finished images in memory or in work had for them.");
	for (int i = 0; i < IMAGE_SOURCE_COUNT; i++)
		text_printf(text, "stratus_image_requests_total{source=\"%s\"} %lu\n", image_names[i], metrics->images[i]);
	write_family(text, "image_cache_bytes", "gauge", "Memory of finished images.");
	text_printf(text, "stratus_image_cache_bytes %zu\n", finished->bytes);
	write_family(text, "image_cache_limit_bytes", "gauge", "Memory that finished images may take.");
	text_printf(text, "stratus_image_cache_limit_bytes %zu\n", finished->bound);
	write_family(text, "image_cache_images", "gauge", "Finished images in memory.");
	text_printf(text, "stratus_image_cache_images %zu\n", finished->images);
	write_family(text, "image_cache_evictions", "counter", "Finished images dropped for want of room.");
	text_printf(text, "stratus_image_cache_evictions_total %llu\n", (unsigned long long)finished->evicted);
}

/* The read-back remembers nothing. */
static void write_cache(struct text *text, const struct metrics_now *now)
{
	write_family(text, "gpu_memory_bytes", "gauge", "GPU memory of what a stage remembers.");
	for (int stage = 0; stage < STAGE_READBACK; stage++)
		text_printf(text, "stratus_gpu_memory_bytes{stage=\"%s\"} %zu\n", stage_names[stage], now->cache_bytes[stage]);
	write_family(text, "gpu_memory_limit_bytes", "gauge", "GPU memory that the stages may keep together beyond the frame in work.");
	text_printf(text, "stratus_gpu_memory_limit_bytes %zu\n", now->cache_limit);
}

static void write_label(struct text *text, const char *name, const char *value)
{
	text_printf(text, "%s=\"", name);
	for (; *value; value++) {
		if (*value == '"' || *value == '\\')
			text_add(text, "\\");
		text_append(text, *value == '\n' ? " " : value, 1);
	}
	text_add(text, "\"");
}

static void write_infos(struct text *text, const struct renderer_info *info)
{
	write_family(text, "build", "info", "The running program.");
	text_printf(text, "stratus_build_info{version=\"%s\"} 1\n", RENDERER_VERSION);
	if (!info)
		return;
	write_family(text, "gl", "info", "The OpenGL in use.");
	text_add(text, "stratus_gl_info{");
	write_label(text, "vendor", info->vendor);
	write_label(text, ",renderer", info->renderer);
	write_label(text, ",version", info->version);
	write_label(text, ",software", info->software ? "1" : "0");
	text_add(text, "} 1\n");
}

static unsigned long open_descriptors(void)
{
	unsigned long count = 0;
	DIR *directory = opendir("/proc/self/fd");
	if (!directory)
		return 0;
	for (const struct dirent *entry; (entry = readdir(directory));)
		count += *entry->d_name != '.';
	closedir(directory);
	return count - 1; /* the directory's own */
}

static void write_process(struct text *text, const struct metrics *metrics)
{
	struct rusage usage;
	if (getrusage(RUSAGE_SELF, &usage) == 0) {
		write_family(text, "process_cpu_seconds", "counter", "Processor time of the process.");
		text_printf(text, "stratus_process_cpu_seconds_total %.3f\n",
			    (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
				    (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec) * 1e-6);
	}
	write_family(text, "process_start_time_seconds", "gauge", "Unix time at which the process started.");
	text_printf(text, "stratus_process_start_time_seconds %.0f\n", metrics->started_s);
	write_family(text, "process_open_fds", "gauge", "Open file descriptors.");
	text_printf(text, "stratus_process_open_fds %lu\n", open_descriptors());
	struct rlimit limit;
	if (getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
		write_family(text, "process_max_fds", "gauge", "File descriptors that may be open.");
		text_printf(text, "stratus_process_max_fds %llu\n", (unsigned long long)limit.rlim_cur);
	}
	write_family(text, "process_resident_memory_bytes", "gauge", "Resident memory of the process.");
	text_printf(text, "stratus_process_resident_memory_bytes %.0f\n", process_resident_bytes());
}

char *metrics_format(struct metrics *metrics, const struct metrics_now *now)
{
	struct text text = {0};
	pthread_mutex_lock(&metrics->mutex);
	struct metrics *copy = malloc(sizeof *copy);
	if (copy)
		*copy = *metrics;
	pthread_mutex_unlock(&metrics->mutex);
	if (!copy)
		return NULL;
	write_requests(&text, copy);
	write_answers(&text, copy);
	write_stages(&text, copy);
	write_queue(&text, copy, now);
	write_admission(&text, copy, now);
	write_care(&text, &now->care);
	write_images(&text, copy, &now->finished);
	write_tracings(&text, copy, now);
	write_droplets(&text, &now->droplets);
	write_assets(&text, now);
	write_keys(&text, now);
	write_cache(&text, now);
	write_infos(&text, now->info);
	write_process(&text, copy);
	text_add(&text, "# EOF\n");
	free(copy);
	return text_take(&text);
}
