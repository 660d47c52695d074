#include "server/service.h"

#include "renderer/log.h"
#include "renderer/optics/kernel.h"
#include "renderer/optics/slab.h"
#include "server/clock.h"
#include "server/digest.h"
#include "server/http.h"
#include "server/response.h"
#include "server/text.h"
#include "server/tls.h"

#include <pthread.h>
#include <stdlib.h>
#include <unistd.h>

/* Computing droplets for longer than this is a hang that a restart cures. */
#define PREPARATION_MS_MAX 300000.0

/* What is left when the renderer is gone is refused within so long; when nothing more is answered for a while the rest hangs with it. */
#define ABANDON_MS_MAX   3000.0
#define ABANDON_MS_STILL 300.0

/* What a shutdown gives up: that renders end, which they do between two passes, and that their clients read why. With --drain-s this and
 * some seconds for all else are TimeoutStopSec= in ops/stratusd.service. */
#define GIVE_UP_MS_MAX 10000.0
#define REFUSE_MS_MAX  5000.0

/* Tracing photons takes what rendering and encoding leave. */
enum { COMPUTER_COUNT = 2, DECODER_NICE = 2, COMPUTER_NICE = 5, TRACER_NICE = 10 };

static size_t worker_count(const struct config *config)
{
	long processors = sysconf(_SC_NPROCESSORS_ONLN);
	if (config->workers > 0)
		return (size_t)config->workers;
	return processors < 1 ? 1 : processors > 16 ? 16 : (size_t)processors;
}

/* What an entity tag must know besides the scene: two builds may round differently, so the program itself is part of it, shaders embedded.
 * Last bits of the solved slab depend on the processor's vectors. Shaders read from disk may change between two starts of one version, so a
 * start then counts as a version of its own. */
static char *pixel_version(const struct service *service)
{
	struct text text = {0};
	char program[DIGEST_SIZE] = "";
	digest_of_file("/proc/self/exe", program);
	text_printf(&text, "%s|%s|%s|%d|%llx", RENDERER_VERSION, program, service->images->version, slab_vector_bytes(),
		    kernel_hash(render_thread_kernel(service->render_thread)));
	if (service->config->shader_dir)
		text_printf(&text, "|%d|%f", (int)getpid(), clock_now_ms());
	return text_take(&text);
}

static void *load_images(void *context)
{
	struct service *service = context;
	service->images = image_module_load(service->config->image_module);
	return NULL;
}

/* The image module takes as long to load as OpenGL to start: both at once. The module is never unloaded. */
static bool start_rendering(struct service *service)
{
	pthread_t loader;
	service->render_thread = render_thread_create(service->config, service->queue, service->costs);
	if (!service->render_thread)
		return false;
	if (pthread_create(&loader, NULL, load_images, service) != 0) {
		log_error("service_create: pthread_create failed");
		return false;
	}
	pthread_join(loader, NULL);
	return service->images != NULL;
}

static bool open_assets(struct service *service)
{
	const struct config *config = service->config;
	const struct asset_limits limits = {.file_bytes = (uint64_t)config->asset_max_mb << 20,
					    .total_bytes = (uint64_t)config->assets_disk_mb << 20,
					    .count = (size_t)config->asset_count};
	service->assets = asset_store_create(config->state_dir, &limits);
	service->maps = asset_maps_create((size_t)config->assets_mb << 20);
	service->decoder = decoder_create(config->image_module, &decoder_default_limits);
	return service->assets && service->maps && service->decoder;
}

static struct render_queue_limits queue_limits(const struct config *config, int jobs)
{
	return (struct render_queue_limits){(size_t)jobs, 1e6 * config->queue_mpixels};
}

/* What waits for droplets or maps leaves places to what could be rendered at once. */
static int side_line_length(const struct config *config)
{
	return (config->queue_length + 1) / 2;
}

/* What was begun is the render thread's to end. */
static bool is_over(struct render_job *job, void *context)
{
	(void)context;
	return !job->pending && render_job_is_over(job);
}

/* Images that a device made which renders wrongly are not kept: from the failed proof until it is in order again. */
static void drop_wrong(struct service *service)
{
	const bool in_order = render_thread_state(service->render_thread) == RENDER_THREAD_READY;
	const unsigned long wrong = render_thread_care(service->render_thread).golden_failed;
	if (wrong == service->wrong_seen)
		return;
	image_cache_clear(service->finished);
	if (in_order)
		service->wrong_seen = wrong;
}

/* Renders that wait and that nobody waits for any more, or not in time, make room at once. */
static void drop_over(void *context)
{
	struct service *service = context;
	if (!service->ready)
		return;
	for (struct render_job *job; (job = render_queue_remove(service->queue, is_over, NULL));)
		job->finished(job);
	preparation_drop_over(service->preparation);
	worker_pool_sweep(service->decoders);
	drop_wrong(service);
	encoder_care_look(&service->encoders, service->images);
}

struct service *service_create(const struct config *config)
{
	struct service *service = calloc(1, sizeof *service);
	if (!service) {
		log_error("service_create: out of memory");
		return NULL;
	}
	size_t workers = worker_count(config);
	service->config = config;
	service->listening_socket = -1;
	service->metrics = metrics_create();
	service->finished = image_cache_create((size_t)config->images_mb << 20);
	service->flights = service->finished ? flights_create(service->finished) : NULL;
	service->intake = intake_create((size_t)config->queue_length);
	const struct render_queue_limits limits = queue_limits(config, config->queue_length);
	service->queue = render_queue_create(&limits);
	service->costs = cost_model_create();
	const struct connections_params watched = {.total = (size_t)config->connections,
						   .per_address = (size_t)config->connections_per_address,
						   .read_ms = 1e3 * config->read_timeout_s,
						   .is_encrypted = config->tls_cert != NULL,
						   .tick = drop_over,
						   .context = service};
	service->connections = connections_create(&watched);
	service->workers = worker_pool_create(workers, 2 * workers, 0);
	service->computers = worker_pool_create(COMPUTER_COUNT, (size_t)config->queue_length, COMPUTER_NICE);
	service->tracers = worker_pool_create(1, SERVICE_TRACINGS_MAX, TRACER_NICE);
	service->decoders = worker_pool_create(1, (size_t)side_line_length(config), DECODER_NICE);
	const bool pools = service->connections && service->intake && service->costs && service->flights && service->workers &&
			   service->computers && service->tracers && service->decoders;
	service->keys = api_keys_create(config->keys);
	const bool guarded = service->keys && (!config->tls_cert || tls_load(config->tls_cert, config->tls_key));
	if (pools && guarded && open_assets(service) && service->metrics && service->queue && http_start(service) &&
	    start_rendering(service))
		return service;
	service_destroy(service);
	return NULL;
}

/* What needs the renderer; tried again when there was no memory. */
static bool finish_start(struct service *service)
{
	if (!service->pixel_version)
		service->pixel_version = pixel_version(service);
	const struct render_queue_limits limits = queue_limits(service->config, side_line_length(service->config));
	if (!service->preparation)
		service->preparation = preparation_create(render_thread_droplets(service->render_thread), service->queue, &limits);
	return service->pixel_version && service->preparation;
}

enum service_state service_wait(struct service *service, int milliseconds)
{
	double until = clock_now_ms() + milliseconds;
	enum render_thread_state state;
	while ((state = render_thread_state(service->render_thread)) == RENDER_THREAD_STARTING && clock_now_ms() < until)
		usleep(5000);
	if (state == RENDER_THREAD_READY && !service->ready)
		service->ready = finish_start(service);
	return service_state(service);
}

static void await_answers(const struct service *service, double milliseconds)
{
	const double limit_ms = clock_now_ms() + milliseconds;
	while (service->in_flight > 0 && clock_now_ms() < limit_ms)
		usleep(5000);
}

/* Answers to accepted requests go out: each is done, or late, by its own deadline. What is left when the time for that is over, clients
 * that do not read their answers among it, is given up. */
static void drain(struct service *service)
{
	await_answers(service, 1e3 * service->config->drain_s);
	if (service->suspended > 0)
		log_warning("shutdown: %zu requests are not done after %d s (--drain-s), and are answered so", (size_t)service->suspended,
			    service->config->drain_s);
	service->giving_up = true;
	if (service->decoder)
		decoder_give_up(service->decoder);
}

/* Renders may outlast those who waited for them, for as long as a pass takes. */
static bool is_working(const struct service *service)
{
	return service->suspended > 0 || (service->flights && flights_open(service->flights) > 0);
}

/* libmicrohttpd must not stop while a connection is suspended. Jobs are abandoned between two passes, so this is quick unless one hangs;
 * then nothing is left that could be saved. */
static void await_suspended(struct service *service)
{
	double limit = clock_now_ms() + GIVE_UP_MS_MAX;
	while (is_working(service) && clock_now_ms() < limit)
		usleep(1000);
	if (is_working(service)) {
		log_error("shutdown: a render hangs, leaving it");
		_exit(EXIT_FAILURE);
	}
}

void service_destroy(struct service *service)
{
	if (!service)
		return;
	service->stopping = true;
	http_quiesce(service);
	drain(service);
	await_suspended(service);
	await_answers(service, REFUSE_MS_MAX);
	connections_stop(service->connections);
	http_stop(service);
	preparation_destroy(service->preparation);
	if (service->queue)
		render_queue_close(service->queue);
	render_thread_destroy(service->render_thread);
	worker_pool_destroy(service->workers);
	worker_pool_destroy(service->computers);
	worker_pool_destroy(service->tracers);
	worker_pool_destroy(service->decoders);
	decoder_destroy(service->decoder);
	flights_destroy(service->flights);
	image_cache_destroy(service->finished);
	asset_maps_destroy(service->maps);
	asset_store_destroy(service->assets);
	render_queue_destroy(service->queue);
	intake_destroy(service->intake);
	cost_model_destroy(service->costs);
	connections_destroy(service->connections);
	metrics_destroy(service->metrics);
	api_keys_destroy(service->keys);
	tls_unload();
	free(service->pixel_version);
	free(service);
}

static bool is_any(struct render_job *job, void *context)
{
	(void)job, (void)context;
	return true;
}

static void refuse_queued(struct service *service)
{
	for (struct render_job *job; (job = render_queue_remove(service->queue, is_any, NULL));) {
		job->outcome = RENDER_OUTCOME_UNAVAILABLE;
		job->finished(job);
	}
}

void service_abandon(struct service *service)
{
	const double limit_ms = clock_now_ms() + ABANDON_MS_MAX;
	service->abandoned = true;
	service->stopping = true;
	http_quiesce(service);
	size_t before = service->in_flight;
	double changed_ms = clock_now_ms();
	while (service->in_flight > 0 && clock_now_ms() < limit_ms && clock_now_ms() < changed_ms + ABANDON_MS_STILL) {
		refuse_queued(service);
		usleep(5000);
		if (service->in_flight != before)
			changed_ms = clock_now_ms();
		before = service->in_flight;
	}
	if (service->in_flight > 0)
		log_error("%zu requests are left without an answer", (size_t)service->in_flight);
}

bool service_reload(struct service *service)
{
	const struct config *config = service->config;
	const bool keys = api_keys_reload(service->keys);
	const bool certificate = !config->tls_cert || tls_load(config->tls_cert, config->tls_key);
	if (!keys || !certificate)
		log_error("reload: %s%s%s of before stay in force", keys ? "" : "the keys", keys || certificate ? "" : " and ",
			  certificate ? "" : "the certificate");
	return keys && certificate;
}

enum service_state service_state(const struct service *service)
{
	if (service->render_thread && render_thread_state(service->render_thread) == RENDER_THREAD_FAILED)
		return SERVICE_FAILED;
	if (service->render_thread && render_thread_hangs(service->render_thread))
		return SERVICE_FAILED;
	if (service->ready && preparation_busy_ms(service->preparation) > PREPARATION_MS_MAX)
		return SERVICE_FAILED;
	if (service->stopping)
		return SERVICE_STOPPING;
	if (!service->ready)
		return SERVICE_STARTING;
	const bool recovers = render_thread_state(service->render_thread) == RENDER_THREAD_RECOVERING;
	return recovers || encoder_care_is_broken(&service->encoders) ? SERVICE_RECOVERING : SERVICE_READY;
}

size_t service_queue_depth(const struct service *service)
{
	return render_queue_depth(service->queue) + (service->ready ? preparation_depth(service->preparation) : 0);
}

double service_queue_pixels(const struct service *service)
{
	return render_queue_pixels(service->queue) + (service->ready ? preparation_pixels(service->preparation) : 0);
}

static unsigned whole_seconds(double milliseconds)
{
	double seconds = milliseconds * 1e-3;
	return seconds < 1 ? 1 : seconds > 60 ? 60 : (unsigned)seconds;
}

unsigned service_computing_retry_seconds(const struct service *service)
{
	return whole_seconds((double)worker_pool_waiting(service->computers) * service->computing_ms / COMPUTER_COUNT);
}

/* Before the first has ended a tracing is taken for one that fills the usual deadline. */
unsigned service_tracing_retry_seconds(const struct service *service)
{
	const double each = service->tracing_ms > 0 ? service->tracing_ms : service->config->timeout_ms;
	return whole_seconds((double)(1 + worker_pool_waiting(service->tracers)) * each);
}

bool service_refuses(struct request *request)
{
	struct service *service = request->service;
	if (service->abandoned || (service->ready && service_state(service) == SERVICE_FAILED)) {
		problem_set(&request->problem, PROBLEM_UNAVAILABLE, "The renderer is gone, and the service starts anew.");
		metrics_count_rejection(service->metrics, REJECTED_UNAVAILABLE);
	} else if (service->stopping) {
		problem_set(&request->problem, PROBLEM_SHUTTING_DOWN, "The service is shutting down.");
		metrics_count_rejection(service->metrics, REJECTED_SHUTTING_DOWN);
	} else if (!service->ready) {
		problem_set(&request->problem, PROBLEM_STARTING, "The renderer is not ready yet.");
		metrics_count_rejection(service->metrics, REJECTED_STARTING);
	}
	return request->problem.kind != PROBLEM_NONE;
}
