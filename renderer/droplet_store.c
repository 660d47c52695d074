#include "renderer/droplet_store.h"

#include "renderer/droplet_disk.h"
#include "renderer/droplet_entries.h"
#include "renderer/log.h"
#include "renderer/optics/kernel.h"

#include <pthread.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

enum {
	DEFAULT_MEMORY_BYTES = 256 << 20,
	DEFAULT_DISK_BYTES = 1 << 30,
	DEFAULT_THREADS_MAX = 4,
	TOUCH_SECONDS = 60 /* how far the disk's memory of the last use may be behind */
};

struct droplet_store {
	const struct kernel *kernel;
	struct droplet_disk *disk; /* NULL: none */
	int threads;

	pthread_mutex_t mutex; /* never held while anything is read, computed or freed */
	pthread_cond_t obtained, released;
	struct droplet_entries entries;
	struct droplet_store_counts counts; /* but its bytes */

	/* Computations begin in the order they came, as many at once as have processors of their own: more would only all come late. */
	pthread_cond_t computed;
	unsigned long asked_count, computed_count, computed_at_once;
};

/* --- computing: without the mutex ------------------------------------------------------------------------------------------------- */

static void await_turn(struct droplet_store *store)
{
	pthread_mutex_lock(&store->mutex);
	unsigned long mine = store->asked_count++;
	while (mine >= store->computed_count + store->computed_at_once)
		pthread_cond_wait(&store->computed, &store->mutex);
	pthread_mutex_unlock(&store->mutex);
}

static void end_turn(struct droplet_store *store)
{
	pthread_mutex_lock(&store->mutex);
	store->computed_count++;
	pthread_cond_broadcast(&store->computed);
	pthread_mutex_unlock(&store->mutex);
}

static struct scene_dsd dsd_of(const struct droplet_key *key)
{
	return (struct scene_dsd){key->n0_per_cm3, key->gamma, key->effective_radius_um};
}

static void *compute_tables(struct droplet_store *store, const struct droplet_key *key)
{
	struct scene_dsd dsd = dsd_of(key);
	await_turn(store);
	struct droplet_tables *tables = droplet_tables_create(store->kernel, &dsd, (enum optics_model)key->model, store->threads);
	end_turn(store);
	return tables;
}

static void *compute_fit(struct droplet_store *store, const struct droplet_key *key)
{
	struct scene_dsd dsd = dsd_of(key);
	const struct droplet_tables *tables = droplet_store_get(store, &dsd, (enum optics_model)key->model, NULL);
	if (!tables)
		return NULL;
	struct paper_fit_table *fit = calloc(1, sizeof *fit);
	await_turn(store);
	bool ok = fit && paper_fit_table_compute(tables->optics, tables->slab, store->threads, fit);
	end_turn(store);
	droplet_store_release(store, tables);
	if (ok)
		return fit;
	if (!fit)
		log_error("droplets: out of memory");
	free(fit);
	return NULL;
}

static void *obtain_value(struct droplet_store *store, const struct droplet_key *key, enum droplet_source *source)
{
	void *value = NULL;
	*source = DROPLETS_FROM_DISK;
	if (store->disk && droplet_disk_read(store->disk, key, &value) == DROPLET_FILE_BAD) {
		pthread_mutex_lock(&store->mutex);
		store->counts.damaged_files++;
		pthread_mutex_unlock(&store->mutex);
	}
	if (value)
		return value;
	*source = DROPLETS_COMPUTED;
	return key->kind == DROPLET_TABLES ? compute_tables(store, key) : compute_fit(store, key);
}

/* --- asking ----------------------------------------------------------------------------------------------------------------------- */

static time_t now_seconds(void)
{
	struct timespec now;
	clock_gettime(CLOCK_MONOTONIC_COARSE, &now);
	return now.tv_sec;
}

/* The disk must not take for unused what memory answers all the time. */
static void note_use(struct droplet_store *store, struct droplet_entry *entry)
{
	time_t now = now_seconds();
	if (!store->disk || now - entry->touched < TOUCH_SECONDS)
		return;
	entry->touched = now;
	droplet_disk_touch(store->disk, &entry->key);
}

/* For the first who asks, with the mutex held, which is given up meanwhile. */
static void obtain_entry(struct droplet_store *store, struct droplet_entry *entry, enum droplet_source *source)
{
	pthread_mutex_unlock(&store->mutex);
	void *value = obtain_value(store, &entry->key, source);
	pthread_mutex_lock(&store->mutex);
	droplet_entries_settle(&store->entries, entry, value);
	entry->touched = now_seconds();
	entry->writing = value && store->disk && *source == DROPLETS_COMPUTED;
	pthread_cond_broadcast(&store->obtained);
}

/* The entry of a key, held; NULL when its value cannot be had. With the mutex held. */
static struct droplet_entry *hold_entry(struct droplet_store *store, const struct droplet_key *key, enum droplet_source *source)
{
	struct droplet_entry *entry = droplet_entries_find(&store->entries, key);
	bool first = !entry;
	*source = DROPLETS_FROM_MEMORY;
	if (first)
		entry = droplet_entries_add(&store->entries, key);
	if (!entry) {
		log_error("droplets: out of memory");
		return NULL;
	}
	droplet_entries_hold(&store->entries, entry);
	if (first)
		obtain_entry(store, entry, source);
	while (entry->state == DROPLET_OBTAINING)
		pthread_cond_wait(&store->obtained, &store->mutex);
	if (entry->state == DROPLET_FAILED) {
		droplet_entries_unhold(&store->entries, entry);
		return NULL;
	}
	note_use(store, entry);
	store->counts.from[*source]++;
	return entry;
}

/* The value of a key, held. */
static void *get_value(struct droplet_store *store, const struct droplet_key *key, enum droplet_source *source)
{
	enum droplet_source from;
	pthread_mutex_lock(&store->mutex);
	struct droplet_entry *entry = hold_entry(store, key, &from), *excess = droplet_entries_excess(&store->entries);
	pthread_mutex_unlock(&store->mutex);
	if (entry && from == DROPLETS_COMPUTED && store->disk)
		droplet_disk_write(store->disk, key, entry->value);
	droplet_entries_free(excess);
	if (source)
		*source = from;
	return entry ? entry->value : NULL;
}

static void release_value(struct droplet_store *store, const void *value)
{
	pthread_mutex_lock(&store->mutex);
	droplet_entries_unhold(&store->entries, droplet_entries_of(&store->entries, value));
	struct droplet_entry *excess = droplet_entries_excess(&store->entries);
	pthread_cond_broadcast(&store->released);
	pthread_mutex_unlock(&store->mutex);
	droplet_entries_free(excess);
}

static void on_written(void *context, const void *value)
{
	struct droplet_store *store = context;
	pthread_mutex_lock(&store->mutex);
	droplet_entries_of(&store->entries, value)->writing = false;
	struct droplet_entry *excess = droplet_entries_excess(&store->entries);
	pthread_mutex_unlock(&store->mutex);
	droplet_entries_free(excess);
}

const struct droplet_tables *droplet_store_get(struct droplet_store *store, const struct scene_dsd *dsd, enum optics_model model,
					       enum droplet_source *source)
{
	struct droplet_key key = droplet_key_make(DROPLET_TABLES, dsd, model);
	return get_value(store, &key, source);
}

void droplet_store_release(struct droplet_store *store, const struct droplet_tables *tables)
{
	if (tables)
		release_value(store, tables);
}

bool droplet_store_get_fit(struct droplet_store *store, const struct scene_dsd *dsd, enum optics_model model, struct paper_fit_table *fit,
			   enum droplet_source *source)
{
	struct droplet_key key = droplet_key_make(DROPLET_FIT, dsd, model);
	struct paper_fit_table *found = get_value(store, &key, source);
	if (!found)
		return false;
	*fit = *found;
	release_value(store, found);
	return true;
}

/* --- asking without waiting ------------------------------------------------------------------------------------------------------- */

const struct droplet_tables *droplet_store_find(struct droplet_store *store, const struct scene_dsd *dsd, enum optics_model model)
{
	struct droplet_key key = droplet_key_make(DROPLET_TABLES, dsd, model);
	const struct droplet_tables *tables = NULL;
	pthread_mutex_lock(&store->mutex);
	struct droplet_entry *entry = droplet_entries_find(&store->entries, &key);
	if (entry && entry->state == DROPLET_READY && (entry->holds > 0 || droplet_entries_have_room(&store->entries, entry->bytes))) {
		droplet_entries_hold(&store->entries, entry);
		note_use(store, entry);
		store->counts.from[DROPLETS_FROM_MEMORY]++;
		tables = entry->value;
	}
	pthread_mutex_unlock(&store->mutex);
	return tables;
}

bool droplet_store_await_room(struct droplet_store *store, int milliseconds)
{
	struct timespec until;
	clock_gettime(CLOCK_MONOTONIC, &until);
	until.tv_nsec += 1000000L * (milliseconds % 1000);
	until.tv_sec += milliseconds / 1000 + until.tv_nsec / 1000000000;
	until.tv_nsec %= 1000000000;
	pthread_mutex_lock(&store->mutex);
	bool room;
	while (!(room = droplet_entries_have_room(&store->entries, droplet_file_bytes(DROPLET_TABLES))) &&
	       pthread_cond_timedwait(&store->released, &store->mutex, &until) == 0)
		;
	pthread_mutex_unlock(&store->mutex);
	return room;
}

static bool is_ready(struct droplet_store *store, const struct droplet_key *key)
{
	const struct droplet_entry *entry = droplet_entries_find(&store->entries, key);
	return entry && entry->state == DROPLET_READY;
}

bool droplet_store_has(struct droplet_store *store, const struct scene_dsd *dsd, enum optics_model model, bool fit)
{
	struct droplet_key tables_key = droplet_key_make(DROPLET_TABLES, dsd, model), fit_key = droplet_key_make(DROPLET_FIT, dsd, model);
	pthread_mutex_lock(&store->mutex);
	bool has = is_ready(store, &tables_key) && (!fit || is_ready(store, &fit_key));
	pthread_mutex_unlock(&store->mutex);
	return has;
}

struct droplet_store_counts droplet_store_counts(struct droplet_store *store)
{
	pthread_mutex_lock(&store->mutex);
	struct droplet_store_counts counts = store->counts;
	counts.memory_bytes = store->entries.bytes;
	pthread_mutex_unlock(&store->mutex);
	return counts;
}

/* --- life ------------------------------------------------------------------------------------------------------------------------- */

static void share_processors(struct droplet_store *store, int threads)
{
	long online = sysconf(_SC_NPROCESSORS_ONLN);
	int processors = online < 1 ? 1 : online < 1024 ? (int)online : 1024;
	store->threads = threads > 0 ? threads : processors < DEFAULT_THREADS_MAX ? processors : DEFAULT_THREADS_MAX;
	store->computed_at_once = processors > store->threads ? (unsigned long)(processors / store->threads) : 1;
}

static void init_locks(struct droplet_store *store)
{
	pthread_condattr_t monotonic;
	pthread_condattr_init(&monotonic);
	pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
	pthread_mutex_init(&store->mutex, NULL);
	pthread_cond_init(&store->obtained, NULL);
	pthread_cond_init(&store->computed, NULL);
	pthread_cond_init(&store->released, &monotonic);
	pthread_condattr_destroy(&monotonic);
}

static bool start_disk(struct droplet_store *store, const struct droplet_store_params *params)
{
	const struct droplet_disk_params disk = {.directory = params->directory,
						 .bytes = params->disk_bytes ? params->disk_bytes : DEFAULT_DISK_BYTES,
						 .kernel_hash = kernel_hash(params->kernel),
						 .written = on_written,
						 .context = store};
	if (params->directory)
		store->disk = droplet_disk_create(&disk);
	return !params->directory || store->disk;
}

struct droplet_store *droplet_store_create(const struct droplet_store_params *params)
{
	struct droplet_store *store = calloc(1, sizeof *store);
	if (!store) {
		log_error("droplets: out of memory");
		return NULL;
	}
	init_locks(store);
	store->kernel = params->kernel;
	share_processors(store, params->threads);
	store->entries.bound = params->memory_bytes ? params->memory_bytes : DEFAULT_MEMORY_BYTES;
	if (start_disk(store, params))
		return store;
	droplet_store_destroy(store);
	return NULL;
}

void droplet_store_destroy(struct droplet_store *store)
{
	if (!store)
		return;
	droplet_disk_destroy(store->disk);
	droplet_entries_free(store->entries.first);
	pthread_cond_destroy(&store->released);
	pthread_cond_destroy(&store->computed);
	pthread_cond_destroy(&store->obtained);
	pthread_mutex_destroy(&store->mutex);
	free(store);
}
