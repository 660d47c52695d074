#include "server/renderer_care.h"

#include "renderer/golden.h"
#include "renderer/log.h"
#include "server/process_memory.h"

#include <malloc.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Before each try to bring the renderer up again; a driver that resets itself takes some seconds, one that is updated some more. */
static const double pauses_ms[] = {0, 250, 500, 1000, 2000, 4000, 8000, 15000};
enum { TRIES = sizeof pauses_ms / sizeof *pauses_ms };

/* Compiling every shader beats no heart. */
#define START_MS_MAX 120000.0

/* Grown memory is looked at so often, and waits so long for a time when there is nothing to do. */
#define MEMORY_LOOK_MS 1000.0
#define MEMORY_WAIT_MS 30000.0

/* With work throughout, the golden render comes between two pictures after so many times --golden-s. */
#define UNPROVEN_TIMES 4.0

const char *const care_reason_names[CARE_REASON_COUNT] = {
	[CARE_NONE] = "none",     [CARE_GUILTY] = "guilty",     [CARE_INNOCENT] = "innocent", [CARE_UNKNOWN] = "unknown",
	[CARE_GOLDEN] = "golden", [CARE_FAILURES] = "failures", [CARE_MEMORY] = "memory"};

static const char *const explanations[CARE_REASON_COUNT] = {[CARE_GUILTY] = "its context was lost",
							    [CARE_INNOCENT] = "its context was lost",
							    [CARE_UNKNOWN] = "its context was lost",
							    [CARE_GOLDEN] = "the golden render failed",
							    [CARE_FAILURES] = "one render after the other failed",
							    [CARE_MEMORY] = "its memory has grown"};

/* Other threads read of a device while another one takes its place: so none is freed before the end. */
struct device {
	struct device *older;
	char vendor[128], renderer[128], version[128], platform[64];
	struct renderer_info info;
};

struct renderer_care {
	const struct config *config;
	struct droplet_store *droplets;
	struct heartbeat *heartbeat;
	pthread_mutex_t mutex; /* of the pointer to the renderer, for those who count its bytes */
	struct renderer *renderer;
	struct device *devices; /* the last one first */
	_Atomic(const struct renderer_info *) info;
	struct golden_picture expected;
	double golden_ms;                   /* when it was rendered last */
	double process_bytes, device_bytes; /* beside what is known of, when the renderer was new */
	double memory_ms, grown_since_ms;   /* looked at last; 0: it has not grown */
	_Atomic unsigned long resets[CARE_REASON_COUNT], golden_passed, golden_failed, repeated;
};

/* --- proof ------------------------------------------------------------------------------------------------------------------------ */

struct proof {
	renderer_cancelled *cancelled;
	void *context;
	bool is_urgent, with_sky;
};

/* Whoever is asked shows signs of life, so each is. */
static bool is_cancelled(void *context)
{
	const struct proof *proof = context;
	return proof->cancelled && proof->cancelled(proof->context) && !proof->is_urgent;
}

static enum golden_result prove(struct renderer_care *care, struct proof proof)
{
	struct golden_picture picture;
	enum golden_result result = golden_render(care->renderer, proof.with_sky, is_cancelled, &proof, &picture);
	if (result == GOLDEN_CANCELLED)
		return result;
	if (result == GOLDEN_PASSED && !golden_compare(&picture, &care->expected))
		result = GOLDEN_FAILED;
	*(result == GOLDEN_PASSED ? &care->golden_passed : &care->golden_failed) += 1;
	care->golden_ms = clock_now_ms();
	return result;
}

/* Shaders that somebody works at draw what they draw: the first picture is the measure of the later ones. */
static bool learn_expected(struct renderer_care *care)
{
	care->expected = golden_expected;
	return !care->config->shader_dir || golden_render(care->renderer, false, NULL, NULL, &care->expected) == GOLDEN_PASSED;
}

/* --- memory ----------------------------------------------------------------------------------------------------------------------- */

static double cache_bytes(const struct renderer_care *care)
{
	double bytes = 0;
	for (int stage = 0; stage < STAGE_COUNT; stage++)
		bytes += (double)renderer_cache_bytes(care->renderer, (enum stage)stage);
	return bytes;
}

/* Of the process, but for what has bounds of its own. */
static double process_bytes(const struct renderer_care *care)
{
	const bool shared = renderer_info(care->renderer)->software;
	return process_resident_bytes() - (double)droplet_store_counts(care->droplets).memory_bytes - (shared ? cache_bytes(care) : 0);
}

/* Of the device, likewise, up to a constant. 0 where the driver says nothing. */
static double device_bytes(const struct renderer_care *care)
{
	const double unused = renderer_free_memory();
	return unused < 0 ? 0 : -unused - cache_bytes(care);
}

static void note_memory(struct renderer_care *care)
{
	care->process_bytes = process_bytes(care);
	care->device_bytes = device_bytes(care);
	care->grown_since_ms = 0;
}

static double growth(const struct renderer_care *care)
{
	return fmax(process_bytes(care) - care->process_bytes, device_bytes(care) - care->device_bytes);
}

/* What the allocator keeps for later is no growth. */
static bool has_grown(const struct renderer_care *care)
{
	const double limit = (double)care->config->recycle_mb * (1 << 20);
	if (growth(care) <= limit)
		return false;
	malloc_trim(0);
	return growth(care) > limit;
}

static bool is_to_be_recycled(struct renderer_care *care, bool idle)
{
	const double now_ms = clock_now_ms();
	if (care->config->recycle_mb == 0 || now_ms < care->memory_ms + MEMORY_LOOK_MS)
		return false;
	care->memory_ms = now_ms;
	if (!has_grown(care))
		care->grown_since_ms = 0;
	else if (care->grown_since_ms <= 0)
		care->grown_since_ms = now_ms;
	return care->grown_since_ms > 0 && (idle || now_ms > care->grown_since_ms + MEMORY_WAIT_MS);
}

/* --- life of the renderer --------------------------------------------------------------------------------------------------------- */

static bool is_same_device(const struct renderer_info *a, const struct renderer_info *b)
{
	return strcmp(a->vendor, b->vendor) == 0 && strcmp(a->renderer, b->renderer) == 0 && strcmp(a->version, b->version) == 0 &&
	       strcmp(a->platform, b->platform) == 0 && a->pass_kind == b->pass_kind;
}

/* Lets the others know which device it is. */
static bool publish(struct renderer_care *care)
{
	const struct renderer_info *info = renderer_info(care->renderer);
	if (care->info && is_same_device(care->info, info))
		return true;
	struct device *device = calloc(1, sizeof *device);
	if (!device) {
		log_error("renderer: out of memory");
		return false;
	}
	snprintf(device->vendor, sizeof device->vendor, "%s", info->vendor);
	snprintf(device->renderer, sizeof device->renderer, "%s", info->renderer);
	snprintf(device->version, sizeof device->version, "%s", info->version);
	snprintf(device->platform, sizeof device->platform, "%s", info->platform);
	device->info = *info;
	device->info.vendor = device->vendor;
	device->info.renderer = device->renderer;
	device->info.version = device->version;
	device->info.platform = device->platform;
	if (care->info)
		log_warning("renderer: another device than before: %s, OpenGL %s", info->renderer, info->version);
	device->older = care->devices;
	care->devices = device;
	care->info = &device->info;
	return true;
}

static void set_renderer(struct renderer_care *care, struct renderer *renderer)
{
	pthread_mutex_lock(&care->mutex);
	care->renderer = renderer;
	pthread_mutex_unlock(&care->mutex);
}

static void drop_renderer(struct renderer_care *care)
{
	struct renderer *renderer = care->renderer;
	set_renderer(care, NULL);
	renderer_destroy(renderer);
	malloc_trim(0);
}

/* As before where there was one before: no picture is to change. */
static enum pass_kind pass_kind_of(const struct renderer_care *care)
{
	const struct renderer_info *before = care->info;
	return before ? before->pass_kind : (enum pass_kind)care->config->pass_kind;
}

static bool bring_up(struct renderer_care *care)
{
	const struct config *config = care->config;
	const bool first = !care->info;
	const struct renderer_params params = {
		.device_index = config->device,
		.require_gpu = config->require_gpu,
		.pass_kind = pass_kind_of(care),
		.shader_dir = config->shader_dir,
		.droplets = care->droplets,
		.cache_bytes = (size_t)config->cache_mb << 20,
	};
	heartbeat_begin(care->heartbeat, first ? INFINITY : START_MS_MAX); /* the first start has a supervisor's limit */
	set_renderer(care, renderer_create(&params));
	if (!care->renderer)
		return false;
	if ((!first || learn_expected(care)) && prove(care, (struct proof){0}) == GOLDEN_PASSED && publish(care)) {
		note_memory(care);
		return true;
	}
	log_error("renderer: %s does not render as it should", renderer_info(care->renderer)->renderer);
	drop_renderer(care);
	return false;
}

struct renderer_care *renderer_care_create(const struct config *config, struct droplet_store *droplets, struct heartbeat *heartbeat)
{
	struct renderer_care *care = calloc(1, sizeof *care);
	if (!care) {
		log_error("renderer_care_create: out of memory");
		return NULL;
	}
	care->config = config;
	care->droplets = droplets;
	care->heartbeat = heartbeat;
	pthread_mutex_init(&care->mutex, NULL);
	const bool ok = bring_up(care);
	heartbeat_end(heartbeat);
	if (ok)
		return care;
	renderer_care_destroy(care);
	return NULL;
}

void renderer_care_close(struct renderer_care *care)
{
	drop_renderer(care);
}

void renderer_care_destroy(struct renderer_care *care)
{
	if (!care)
		return;
	for (struct device *device; (device = care->devices);) {
		care->devices = device->older;
		free(device);
	}
	pthread_mutex_destroy(&care->mutex);
	free(care);
}

bool renderer_care_rebuild(struct renderer_care *care, enum care_reason reason)
{
	const double begin_ms = clock_now_ms();
	care->resets[reason]++;
	log_line(reason == CARE_MEMORY ? LOG_INFO : LOG_WARNING, "renderer: made anew, since %s", explanations[reason]);
	heartbeat_begin(care->heartbeat, START_MS_MAX);
	drop_renderer(care);
	for (int i = 0; i < TRIES && !care->renderer; i++) {
		heartbeat_begin(care->heartbeat, START_MS_MAX);
		usleep((useconds_t)(pauses_ms[i] * 1e3));
		if (bring_up(care))
			log_info("renderer: up again after %.0f ms", clock_now_ms() - begin_ms);
		else
			log_warning("renderer: %d of %d tries to bring it up again failed", i + 1, TRIES);
	}
	heartbeat_end(care->heartbeat);
	return care->renderer;
}

/* --- what it is asked for --------------------------------------------------------------------------------------------------------- */

_Static_assert((int)CARE_GUILTY == (int)RENDERER_LOST_GUILTY && (int)CARE_UNKNOWN == (int)RENDERER_LOST_UNKNOWN, "one list");

static bool is_older(const struct renderer_care *care, double times)
{
	const double golden_ms = 1e3 * care->config->golden_s;
	return golden_ms > 0 && clock_now_ms() >= care->golden_ms + times * golden_ms;
}

bool renderer_care_is_unproven(const struct renderer_care *care)
{
	return is_older(care, UNPROVEN_TIMES);
}

enum care_reason renderer_care_look(struct renderer_care *care, bool is_idle, bool is_suspect, renderer_cancelled *cancelled, void *context)
{
	enum renderer_loss loss = renderer_look();
	if (loss != RENDERER_NOT_LOST)
		return (enum care_reason)loss;
	if (is_to_be_recycled(care, is_idle))
		return CARE_MEMORY;
	const bool is_urgent = is_suspect || renderer_care_is_unproven(care);
	if (!is_urgent && !(is_idle && is_older(care, 1)))
		return CARE_NONE;
	heartbeat_begin(care->heartbeat, care->config->hang_ms);
	const enum golden_result result = prove(care, (struct proof){cancelled, context, is_urgent, is_suspect});
	heartbeat_end(care->heartbeat);
	loss = result == GOLDEN_FAILED ? renderer_look() : RENDERER_NOT_LOST;
	return loss ? (enum care_reason)loss : result == GOLDEN_FAILED ? CARE_GOLDEN : CARE_NONE;
}

struct renderer *renderer_care_renderer(const struct renderer_care *care)
{
	return care->renderer;
}

void renderer_care_count_repeat(struct renderer_care *care)
{
	care->repeated++;
}

const struct renderer_info *renderer_care_info(const struct renderer_care *care)
{
	return care->info;
}

size_t renderer_care_cache_bytes(struct renderer_care *care, enum stage stage)
{
	pthread_mutex_lock(&care->mutex);
	const size_t bytes = care->renderer ? renderer_cache_bytes(care->renderer, stage) : 0;
	pthread_mutex_unlock(&care->mutex);
	return bytes;
}

struct care_counts renderer_care_counts(const struct renderer_care *care)
{
	struct care_counts counts = {
		.golden_passed = care->golden_passed, .golden_failed = care->golden_failed, .repeated = care->repeated};
	for (int i = 0; i < CARE_REASON_COUNT; i++)
		counts.resets[i] = care->resets[i];
	return counts;
}
