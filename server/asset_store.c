#include "server/asset_store.h"

#include "renderer/file_replace.h"
#include "renderer/log.h"
#include "server/client_address.h"
#include "server/entity_tag.h"
#include "server/shares.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { NAME_LENGTH_MAX = SCENE_NAME_MAX - 1, RECORD_VERSION = 1 };

struct asset_store {
	char *files, *incoming; /* folders */
	struct asset_limits limits;
	pthread_mutex_t mutex;   /* one change of a name at a time, and what follows */
	uint64_t incoming_bytes; /* of all uploads */
	struct shares *uploads;
};

struct asset_upload {
	struct asset_store *store;
	char name[SCENE_NAME_MAX], client[CLIENT_KEY_SIZE], temporary[PATH_MAX];
	int fd;
	uint64_t bytes, room;     /* that came; that all uploads may take */
	enum asset_result spoilt; /* what became of writing it, when that failed once */
	struct digest digest;
};

/* What stands behind a picture in its file. Another version, machine or program is told by the first members and not read. */
struct record {
	char magic[8];
	uint32_t version, format;
	uint64_t bytes;
	char hash[40];
	int32_t width, height;
	float lowest[ASSET_USE_COUNT], highest[ASSET_USE_COUNT], mean_albedo[3];
	uint32_t zero;
};
static const char record_magic[8] = "stratusA";
_Static_assert(sizeof(struct record) == 104, "a record has no padding");

/* --- life ------------------------------------------------------------------------------------------------------------------------ */

struct asset_store *asset_store_create(const char *state_dir, const struct asset_limits *limits)
{
	struct asset_store *store = calloc(1, sizeof *store);
	bool ok = store != NULL;
	if (ok) {
		store->limits = *limits;
		pthread_mutex_init(&store->mutex, NULL);
		store->uploads = shares_create(ASSET_UPLOADS_MAX);
		ok = store->uploads && asprintf(&store->files, "%s/assets/files", state_dir) >= 0;
	}
	if (ok)
		ok = asprintf(&store->incoming, "%s/assets/incoming", state_dir) >= 0;
	if (!ok) {
		log_error("asset_store_create: out of memory");
		asset_store_destroy(store);
		return NULL;
	}
	file_replace_sweep(store->incoming, "upload");
	return store;
}

void asset_store_destroy(struct asset_store *store)
{
	if (!store)
		return;
	pthread_mutex_destroy(&store->mutex);
	shares_destroy(store->uploads);
	free(store->files);
	free(store->incoming);
	free(store);
}

const struct asset_limits *asset_store_limits(const struct asset_store *store)
{
	return &store->limits;
}

bool asset_name_is_valid(const char *name)
{
	static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.";
	const size_t length = strlen(name);
	return length >= 1 && length <= NAME_LENGTH_MAX && name[0] != '.' && strspn(name, plain) == length;
}

/* --- reading ----------------------------------------------------------------------------------------------------------------------- */

static bool path_of(const struct asset_store *store, const char *name, char path[static PATH_MAX])
{
	if (snprintf(path, PATH_MAX, "%s/%s", store->files, name) < PATH_MAX)
		return true;
	errno = ENAMETOOLONG;
	return false;
}

static bool read_record(int fd, const struct stat *status, struct record *record)
{
	const off_t at = status->st_size - (off_t)sizeof *record;
	return S_ISREG(status->st_mode) && at >= 0 && pread(fd, record, sizeof *record, at) == sizeof *record &&
	       memcmp(record->magic, record_magic, sizeof record_magic) == 0 && record->version == RECORD_VERSION &&
	       record->format < IMAGE_FORMAT_COUNT && record->bytes == (uint64_t)at && record->hash[DIGEST_SIZE - 1] == '\0' &&
	       strspn(record->hash, "0123456789abcdef") == DIGEST_SIZE - 1;
}

enum asset_result asset_store_open(struct asset_store *store, const char *name, struct asset_file *file)
{
	char path[PATH_MAX];
	struct stat status;
	struct record record;
	*file = (struct asset_file){.fd = -1};
	if (!asset_name_is_valid(name) || !path_of(store, name, path))
		return ASSET_MISSING;
	file->fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
	if (file->fd < 0) {
		const bool missing = errno == ENOENT || errno == ENOTDIR || errno == ELOOP;
		if (!missing)
			log_error("asset %s: %s", path, strerror(errno));
		return missing ? ASSET_MISSING : ASSET_FAILED;
	}
	if (fstat(file->fd, &status) != 0 || !read_record(file->fd, &status, &record)) {
		log_warning("asset %s: damaged, or of another version: not used", path);
		asset_file_close(file);
		return ASSET_MISSING;
	}
	file->bytes = record.bytes;
	memcpy(file->hash, record.hash, sizeof file->hash);
	file->facts = (struct asset_facts){.format = (enum image_format)record.format, .width = record.width, .height = record.height};
	memcpy(file->facts.lowest, record.lowest, sizeof record.lowest);
	memcpy(file->facts.highest, record.highest, sizeof record.highest);
	memcpy(file->facts.mean_albedo, record.mean_albedo, sizeof record.mean_albedo);
	file->modified = status.st_mtime;
	return ASSET_OK;
}

void asset_file_close(struct asset_file *file)
{
	if (file->fd >= 0)
		close(file->fd);
	file->fd = -1;
}

static int is_asset(const struct dirent *entry)
{
	return asset_name_is_valid(entry->d_name);
}

static int compare_names(const struct dirent **a, const struct dirent **b)
{
	return strcmp((*a)->d_name, (*b)->d_name);
}

bool asset_store_list(struct asset_store *store, void (*visit)(void *context, const char *name, const struct asset_file *file),
		      void *context)
{
	struct dirent **entries;
	const int count = scandir(store->files, &entries, is_asset, compare_names);
	if (count < 0 && errno != ENOENT) {
		log_error("assets in %s: %s", store->files, strerror(errno));
		return false;
	}
	for (int i = 0; i < count; i++) {
		struct asset_file file;
		if (asset_store_open(store, entries[i]->d_name, &file) == ASSET_OK)
			visit(context, entries[i]->d_name, &file);
		asset_file_close(&file);
		free(entries[i]);
	}
	if (count >= 0)
		free(entries);
	return true;
}

/* Bytes of the picture in a file, by its size alone, at least 1; 0: it is no file. */
static uint64_t bytes_of(int folder, const char *name)
{
	struct stat status;
	if (fstatat(folder, name, &status, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(status.st_mode))
		return 0;
	return (uint64_t)status.st_size > sizeof(struct record) ? (uint64_t)status.st_size - sizeof(struct record) : 1;
}

/* Of all but one name (NULL: of all). */
static void usage_beside(struct asset_store *store, const char *name, size_t *count, uint64_t *bytes)
{
	DIR *folder = opendir(store->files);
	*count = 0;
	*bytes = 0;
	if (!folder)
		return;
	for (struct dirent *entry; (entry = readdir(folder));) {
		if (!asset_name_is_valid(entry->d_name) || (name && strcmp(name, entry->d_name) == 0))
			continue;
		const uint64_t size = bytes_of(dirfd(folder), entry->d_name);
		*count += size > 0;
		*bytes += size;
	}
	closedir(folder);
}

void asset_store_usage(struct asset_store *store, size_t *count, uint64_t *bytes)
{
	usage_beside(store, NULL, count, bytes);
}

/* --- changing --------------------------------------------------------------------------------------------------------------------- */

enum asset_result asset_store_check(struct asset_store *store, const char *name, const struct asset_condition *condition)
{
	struct asset_file file;
	char tag[ENTITY_TAG_SIZE] = "";
	if (!condition->if_match && !condition->if_none_match)
		return ASSET_OK;
	const enum asset_result result = asset_store_open(store, name, &file);
	const bool exists = result == ASSET_OK;
	asset_file_close(&file);
	if (result == ASSET_FAILED)
		return result;
	if (exists)
		snprintf(tag, sizeof tag, "\"%s\"", file.hash);
	if (condition->if_match && !(exists && entity_tag_is_expected(condition->if_match, tag)))
		return ASSET_UNWANTED;
	if (condition->if_none_match && exists && entity_tag_matches(condition->if_none_match, tag))
		return ASSET_UNWANTED;
	return ASSET_OK;
}

enum asset_result asset_store_delete(struct asset_store *store, const char *name, const struct asset_condition *condition)
{
	char path[PATH_MAX];
	if (!asset_name_is_valid(name) || !path_of(store, name, path))
		return ASSET_MISSING;
	pthread_mutex_lock(&store->mutex);
	enum asset_result result = asset_store_check(store, name, condition);
	if (result == ASSET_OK && unlink(path) != 0)
		result = errno == ENOENT || errno == ENOTDIR ? ASSET_MISSING : ASSET_FAILED;
	if (result == ASSET_FAILED)
		log_error("asset %s: %s", path, strerror(errno));
	pthread_mutex_unlock(&store->mutex);
	if (result == ASSET_OK)
		file_sync_directory_of(path);
	return result;
}

/* --- uploads ------------------------------------------------------------------------------------------------------------------------ */

static enum asset_result failure(const char *doing, const char *path)
{
	const bool full = errno == ENOSPC || errno == EDQUOT || errno == EFBIG;
	log_error("asset %s: %s: %s", path, doing, strerror(errno));
	return full ? ASSET_FULL : ASSET_FAILED;
}

/* Admits an upload. Within the mutex. */
static enum asset_result admit(struct asset_upload *upload, uint64_t announced)
{
	struct asset_store *store = upload->store;
	const struct asset_limits *limits = &store->limits;
	size_t count;
	uint64_t bytes;
	usage_beside(store, upload->name, &count, &bytes);
	upload->room = limits->total_bytes > bytes ? limits->total_bytes - bytes : 0;
	if (count >= limits->count || store->incoming_bytes + announced > upload->room || upload->room == 0)
		return ASSET_FULL;
	if (!shares_allow(store->uploads, upload->client))
		return ASSET_BUSY;
	shares_take(store->uploads, upload->client);
	return ASSET_OK;
}

static bool open_temporary(struct asset_upload *upload)
{
	const struct asset_store *store = upload->store;
	char path[PATH_MAX];
	if (!file_make_directories(store->files) || !file_make_directories(store->incoming))
		return false;
	if (snprintf(path, sizeof path, "%s/upload", store->incoming) >= (int)sizeof path) {
		errno = ENAMETOOLONG;
		return false;
	}
	upload->fd = file_replace_begin(path, upload->temporary);
	return upload->fd >= 0;
}

enum asset_result asset_upload_begin(struct asset_store *store, const char *name, uint64_t announced, const char *client,
				     struct asset_upload **upload)
{
	if (announced > store->limits.file_bytes)
		return ASSET_TOO_LARGE;
	struct asset_upload *begun = calloc(1, sizeof *begun);
	*upload = NULL;
	if (!begun)
		return failure("out of memory", name);
	begun->store = store;
	begun->fd = -1;
	snprintf(begun->name, sizeof begun->name, "%s", name);
	snprintf(begun->client, sizeof begun->client, "%s", client);
	digest_begin(&begun->digest);
	pthread_mutex_lock(&store->mutex);
	enum asset_result result = admit(begun, announced);
	pthread_mutex_unlock(&store->mutex);
	if (result != ASSET_OK) {
		free(begun);
		return result;
	}
	if (!open_temporary(begun)) {
		result = failure("cannot make its file", name);
		asset_upload_destroy(begun);
		return result;
	}
	*upload = begun;
	return ASSET_OK;
}

void asset_upload_destroy(struct asset_upload *upload)
{
	if (!upload)
		return;
	if (upload->fd >= 0) {
		if (*upload->temporary)
			unlink(upload->temporary);
		close(upload->fd);
	}
	pthread_mutex_lock(&upload->store->mutex);
	upload->store->incoming_bytes -= upload->bytes;
	shares_give(upload->store->uploads, upload->client);
	pthread_mutex_unlock(&upload->store->mutex);
	free(upload);
}

enum asset_result asset_upload_append(struct asset_upload *upload, const void *bytes, size_t size)
{
	struct asset_store *store = upload->store;
	if (upload->bytes + size > store->limits.file_bytes)
		return ASSET_TOO_LARGE;
	upload->bytes += size;
	pthread_mutex_lock(&store->mutex);
	store->incoming_bytes += size;
	const bool fits = store->incoming_bytes <= upload->room;
	pthread_mutex_unlock(&store->mutex);
	if (!fits)
		return ASSET_FULL;
	if (upload->spoilt == ASSET_OK && !file_write_all(upload->fd, bytes, size))
		upload->spoilt = failure("cannot be written", upload->temporary);
	digest_add(&upload->digest, bytes, size);
	return upload->spoilt;
}

int asset_upload_fd(const struct asset_upload *upload, uint64_t *size)
{
	*size = upload->bytes;
	return upload->fd;
}

static bool write_record(const struct asset_upload *upload, const struct asset_facts *facts, const char *hash)
{
	struct record record = {
		.version = RECORD_VERSION, .format = facts->format, .bytes = upload->bytes, .width = facts->width, .height = facts->height};
	memcpy(record.magic, record_magic, sizeof record_magic);
	memcpy(record.hash, hash, DIGEST_SIZE);
	memcpy(record.lowest, facts->lowest, sizeof record.lowest);
	memcpy(record.highest, facts->highest, sizeof record.highest);
	memcpy(record.mean_albedo, facts->mean_albedo, sizeof record.mean_albedo);
	/* Most of the time goes here, before others have to wait. */
	return file_write_all(upload->fd, &record, sizeof record) && fsync(upload->fd) == 0;
}

/* Within the mutex: conditions and limits as they are now. */
static enum asset_result put_in_place(struct asset_upload *upload, const char *path, const struct asset_condition *condition, bool *created)
{
	const struct asset_limits *limits = &upload->store->limits;
	size_t count;
	uint64_t bytes;
	const enum asset_result result = asset_store_check(upload->store, upload->name, condition);
	if (result != ASSET_OK)
		return result;
	usage_beside(upload->store, upload->name, &count, &bytes);
	if (count >= limits->count || bytes + upload->bytes > limits->total_bytes)
		return ASSET_FULL;
	struct asset_file old;
	*created = asset_store_open(upload->store, upload->name, &old) != ASSET_OK;
	asset_file_close(&old);
	if (!file_replace_finish(upload->fd, upload->temporary, path))
		return failure("cannot be put in place", path);
	upload->temporary[0] = '\0';
	/* From here on it counts as a picture. */
	upload->store->incoming_bytes -= upload->bytes;
	upload->bytes = 0;
	return ASSET_OK;
}

enum asset_result asset_upload_commit(struct asset_upload *upload, const struct asset_facts *facts, const struct asset_condition *condition,
				      bool *created, char hash[static DIGEST_SIZE])
{
	char path[PATH_MAX];
	digest_end(&upload->digest, hash);
	if (!path_of(upload->store, upload->name, path) || !write_record(upload, facts, hash))
		return failure("cannot be written", upload->temporary);
	pthread_mutex_lock(&upload->store->mutex);
	const enum asset_result result = put_in_place(upload, path, condition, created);
	pthread_mutex_unlock(&upload->store->mutex);
	return result;
}
