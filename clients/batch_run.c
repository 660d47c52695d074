#include "clients/batch_run.h"

#include "clients/manifest.h"
#include "clients/output_file.h"
#include "clients/problem.h"
#include "clients/progress.h"
#include "clients/timing.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { REFUSALS_TOLD = 5, TEXT_FLAGS = JSON_COMPACT | JSON_SORT_KEYS | JSON_ENCODE_ANY | JSON_REAL_PRECISION(9) };

struct batch {
	const struct client *client;
	const struct batch_settings *settings;
	const struct scene_list *list;
	struct manifest *manifest;
	struct progress progress;
	int next;
	int retries;
};

/* --- what was made before ------------------------------------------------------------------------------------------------------------ */

static const char *extension_of(const struct scene_item *item)
{
	const char *format = json_string_value(json_object_get(json_object_get(item->scene, "output"), "format"));
	return format && strcmp(format, "exr") == 0 ? "exr" : "png";
}

/* malloc'd; NULL: out of memory */
static char *path_of(const struct batch *batch, const struct scene_item *item)
{
	char *path;
	return asprintf(&path, "%s/%s.%s", batch->settings->folder, item->name, extension_of(item)) < 0 ? NULL : path;
}

static bool same_scene(const json_t *a, const json_t *b)
{
	char *text_a = json_dumps(a, TEXT_FLAGS), *text_b = json_dumps(b, TEXT_FLAGS);
	const bool same = text_a && text_b && strcmp(text_a, text_b) == 0;
	free(text_a);
	free(text_b);
	return same;
}

static bool is_made(const struct batch *batch, const struct scene_item *item)
{
	const json_t *entry = manifest_find(batch->manifest, item->name);
	const json_t *bytes = json_object_get(entry, "bytes");
	struct stat status;
	if (batch->settings->anew || !bytes || !same_scene(json_object_get(entry, "scene"), item->scene))
		return false;
	char *path = path_of(batch, item);
	const bool made = path && stat(path, &status) == 0 && status.st_size == json_integer_value(bytes);
	free(path);
	return made;
}

static int count_made(const struct batch *batch)
{
	int made = 0;
	for (int i = 0; i < batch->list->count; i++)
		made += is_made(batch, &batch->list->item[i]);
	return made;
}

/* --- entries -------------------------------------------------------------------------------------------------------------------------- */

static json_t *begin_entry(const struct scene_item *item)
{
	json_t *entry = json_pack("{s:s}", "name", item->name);
	if (item->labels)
		json_object_set(entry, "labels", item->labels);
	json_object_set(entry, "scene", item->scene);
	return entry;
}

static json_t *entry_of_picture(const struct scene_item *item, const struct http_response *response)
{
	char file[128];
	struct timing_table table;
	json_t *entry = begin_entry(item), *stages = json_object();
	snprintf(file, sizeof file, "%s.%s", item->name, extension_of(item));
	timing_parse(response->server_timing, &table);
	for (int i = 0; i < table.count; i++)
		json_object_set_new(stages, table.row[i].name, json_real(table.row[i].milliseconds));
	json_object_set_new(entry, "file", json_string(file));
	json_object_set_new(entry, "bytes", json_integer((json_int_t)response->size));
	json_object_set_new(entry, "seconds", json_real(response->seconds));
	json_object_set_new(entry, "stages_ms", stages);
	return entry;
}

static json_t *entry_of_refusal(const struct scene_item *item, const struct http_response *response)
{
	json_t *entry = begin_entry(item), *problem = json_loadb(response->body, response->size, 0, NULL);
	json_t *error = json_pack("{s:i}", "status", (int)response->status);
	static const char *const members[] = {"title", "detail", "errors"};
	for (size_t i = 0; i < sizeof members / sizeof *members; i++)
		if (json_object_get(problem, members[i]))
			json_object_set(error, members[i], json_object_get(problem, members[i]));
	json_object_set_new(entry, "error", error);
	json_decref(problem);
	return entry;
}

/* --- the pool's questions ------------------------------------------------------------------------------------------------------------- */

static enum pool_next next_scene(void *context, struct pool_job *job)
{
	struct batch *batch = context;
	while (batch->next < batch->list->count && is_made(batch, &batch->list->item[batch->next]))
		batch->next++;
	if (batch->next == batch->list->count)
		return POOL_END;
	*job = (struct pool_job){batch->next, json_dumps(batch->list->item[batch->next].scene, JSON_COMPACT)};
	batch->next++;
	return POOL_JOB;
}

static int take_picture(struct batch *batch, const struct scene_item *item, const struct http_response *response)
{
	char *path = path_of(batch, item);
	const bool written = path && output_file_write(path, response->body, response->size) &&
			     manifest_add(batch->manifest, entry_of_picture(item, response));
	free(path);
	batch->progress.made += written;
	return written ? CLIENT_OK : CLIENT_UNWRITABLE;
}

/* What every other scene would be answered as well ends it. */
static bool is_for_all(long status)
{
	return status == 401 || status == 403 || status == 404 || status == 405;
}

static int take_refusal(struct batch *batch, const struct scene_item *item, const struct http_response *response)
{
	progress_clear(&batch->progress);
	if (batch->progress.failed++ < REFUSALS_TOLD) {
		fprintf(stderr, "%s: ", item->name);
		problem_print(response);
	} else if (batch->progress.failed == REFUSALS_TOLD + 1) {
		fprintf(stderr, "more are told by the manifest alone\n");
	}
	if (!manifest_add(batch->manifest, entry_of_refusal(item, response)))
		return CLIENT_UNWRITABLE;
	return is_for_all(response->status) ? CLIENT_REFUSED : CLIENT_OK;
}

static int take_answer(void *context, const struct pool_job *job, struct http_response *response)
{
	struct batch *batch = context;
	const struct scene_item *item = &batch->list->item[job->index];
	const bool good = response->status == 200 && strncmp(response->content_type, "image/", 6) == 0;
	return good ? take_picture(batch, item, response) : take_refusal(batch, item, response);
}

static void tick(void *context, int busy, int retries)
{
	struct batch *batch = context;
	batch->retries = retries;
	progress_draw(&batch->progress, busy, retries);
}

/* --- a run ---------------------------------------------------------------------------------------------------------------------------- */

static const char *name_at(const void *context, int i)
{
	return ((const struct scene_list *)context)->item[i].name;
}

static struct manifest *open_manifest(const struct batch_settings *settings)
{
	char *path = NULL;
	if (mkdir(settings->folder, 0777) != 0 && errno != EEXIST) {
		client_error("%s: %s", settings->folder, strerror(errno));
		return NULL;
	}
	if (!settings->manifest && asprintf(&path, "%s/manifest.jsonl", settings->folder) < 0) {
		client_error("out of memory");
		return NULL;
	}
	struct manifest *manifest = manifest_open(settings->manifest ? settings->manifest : path);
	free(path);
	return manifest;
}

int batch_run(const struct client *client, const struct batch_settings *settings, const struct scene_list *list)
{
	struct batch batch = {.client = client, .settings = settings, .list = list, .manifest = open_manifest(settings)};
	const struct pool_work work = {&batch, next_scene, take_answer, tick};
	if (!batch.manifest)
		return CLIENT_UNWRITABLE;
	batch.progress = (struct progress){.what = settings->what, .total = list->count, .kept = count_made(&batch)};
	progress_begin(&batch.progress, client);
	int status = http_pool_run(client, &settings->pool, &work);
	progress_end(&batch.progress, client, batch.retries);
	if (status == CLIENT_OK && !manifest_sort(batch.manifest, name_at, list, list->count))
		status = CLIENT_UNWRITABLE;
	if (status == CLIENT_OK && batch.progress.failed > 0)
		status = CLIENT_REFUSED;
	if (status == CLIENT_INTERRUPTED && !client->quiet)
		fputs("interrupted: the same command goes on where this stopped\n", stderr);
	manifest_close(batch.manifest);
	return status;
}
