#include "server/api_keys.h"

#include "renderer/log.h"
#include "server/clock.h"
#include "server/token_bucket.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

struct key {
	struct key_line line;
	struct token_bucket bucket[KEY_LIMIT_COUNT];
	struct api_key_counts counts;
};

struct table {
	size_t count;
	struct key key[KEYS_MAX];
};

struct api_keys {
	const char *path;
	pthread_mutex_t mutex;
	struct table *table; /* NULL: no keys are asked for */
	struct api_key_counts anonymous;
};

static struct key *find_name(struct table *table, const char *name)
{
	for (size_t i = 0; table && i < table->count; i++)
		if (strcmp(table->key[i].line.name, name) == 0)
			return &table->key[i];
	return NULL;
}

/* A key that stays: its counts, and what is left of its limits. */
static void take_over(struct key *key, const struct key *old, const double limits[static KEY_LIMIT_COUNT], double now_ms)
{
	key->counts = old->counts;
	for (int i = 0; i < KEY_LIMIT_COUNT; i++) {
		key->bucket[i] = old->bucket[i];
		token_bucket_change(&key->bucket[i], limits[i], now_ms);
	}
}

static struct table *read_table(const char *path)
{
	struct key_file *file = malloc(sizeof *file);
	struct table *table = calloc(1, sizeof *table);
	const bool good = file && table && key_file_read(path, file);
	if (!file || !table)
		log_error("keys: out of memory");
	for (size_t i = 0; good && i < file->count; i++)
		table->key[table->count++].line = file->line[i];
	free(file);
	if (!good) {
		free(table);
		return NULL;
	}
	if (table->count == 0)
		log_warning("keys: %s holds none: every request that needs one is refused", path);
	return table;
}

/* Within the mutex. */
static void put_in_force(struct api_keys *keys, struct table *table)
{
	const double now_ms = clock_now_ms();
	for (size_t i = 0; i < table->count; i++) {
		struct key *key = &table->key[i];
		const double limits[KEY_LIMIT_COUNT] = {key->line.requests_per_minute, key->line.megapixels_per_minute};
		const struct key *old = find_name(keys->table, key->line.name);
		for (int k = 0; k < KEY_LIMIT_COUNT; k++)
			token_bucket_init(&key->bucket[k], limits[k], now_ms);
		if (old)
			take_over(key, old, limits, now_ms);
	}
	free(keys->table);
	keys->table = table;
}

struct api_keys *api_keys_create(const char *path)
{
	struct api_keys *keys = calloc(1, sizeof *keys);
	if (!keys) {
		log_error("keys: out of memory");
		return NULL;
	}
	pthread_mutex_init(&keys->mutex, NULL);
	keys->path = path;
	if (path && !api_keys_reload(keys)) {
		api_keys_destroy(keys);
		return NULL;
	}
	return keys;
}

void api_keys_destroy(struct api_keys *keys)
{
	if (!keys)
		return;
	pthread_mutex_destroy(&keys->mutex);
	free(keys->table);
	free(keys);
}

bool api_keys_are_asked_for(const struct api_keys *keys)
{
	return keys->path;
}

bool api_keys_reload(struct api_keys *keys)
{
	if (!keys->path)
		return true;
	struct table *table = read_table(keys->path);
	if (!table)
		return false;
	const size_t count = table->count;
	pthread_mutex_lock(&keys->mutex);
	put_in_force(keys, table);
	pthread_mutex_unlock(&keys->mutex);
	log_info("keys: %zu from %s", count, keys->path);
	return true;
}

bool api_keys_find(struct api_keys *keys, const char *shown, char name[static KEY_NAME_SIZE])
{
	unsigned char hash[API_KEY_HASH_BYTES];
	const struct key *found = NULL;
	if (!api_key_hash(shown, hash))
		return false;
	pthread_mutex_lock(&keys->mutex);
	/* To the end, so that its place cannot be told by the time. */
	for (size_t i = 0; keys->table && i < keys->table->count; i++)
		if (api_key_hashes_match(keys->table->key[i].line.hash, hash))
			found = &keys->table->key[i];
	if (found)
		strcpy(name, found->line.name);
	pthread_mutex_unlock(&keys->mutex);
	return found;
}

double api_keys_take(struct api_keys *keys, const char *name, enum api_key_limit limit, double amount)
{
	double wait_ms = 0;
	pthread_mutex_lock(&keys->mutex);
	struct key *key = find_name(keys->table, name);
	if (key) {
		wait_ms = token_bucket_take(&key->bucket[limit], amount, clock_now_ms());
		key->counts.refused[limit] += wait_ms > 0;
	}
	pthread_mutex_unlock(&keys->mutex);
	return wait_ms;
}

void api_keys_give_back(struct api_keys *keys, const char *name, enum api_key_limit limit, double amount)
{
	pthread_mutex_lock(&keys->mutex);
	struct key *key = find_name(keys->table, name);
	if (key)
		token_bucket_give_back(&key->bucket[limit], amount);
	pthread_mutex_unlock(&keys->mutex);
}

void api_keys_count(struct api_keys *keys, const char *name, double pixels)
{
	pthread_mutex_lock(&keys->mutex);
	struct key *key = find_name(keys->table, name);
	struct api_key_counts *counts = key ? &key->counts : *name ? NULL : &keys->anonymous;
	if (counts) {
		counts->requests++;
		counts->pixels += pixels;
	}
	pthread_mutex_unlock(&keys->mutex);
}

void api_keys_visit(struct api_keys *keys, void (*visit)(void *context, const char *name, const struct api_key_counts *counts),
		    void *context)
{
	pthread_mutex_lock(&keys->mutex);
	visit(context, "anonymous", &keys->anonymous);
	for (size_t i = 0; keys->table && i < keys->table->count; i++)
		visit(context, keys->table->key[i].line.name, &keys->table->key[i].counts);
	pthread_mutex_unlock(&keys->mutex);
}
