#include "renderer/droplet_disk.h"

#include "renderer/file_replace.h"
#include "renderer/log.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <fnmatch.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum {
	TASKS_MAX = 8,    /* that wait; 16 MB each at most */
	FILES_MAX = 1024, /* fits are so small that bytes alone would let them become too many to look through */
	BLOCK = 4096      /* what disks give out */
};

/* value NULL: the file is marked as used. */
struct task {
	struct droplet_key key;
	const void *value;
};

struct droplet_disk {
	char directory[PATH_MAX];
	uint64_t bytes, kernel_hash;
	void (*written)(void *context, const void *value);
	void *context;

	pthread_t thread;
	pthread_mutex_t mutex;
	pthread_cond_t changed;
	struct task tasks[TASKS_MAX]; /* the oldest first */
	int task_count;
	bool closed, failing; /* failing: of the thread alone */
};

/* --- files ------------------------------------------------------------------------------------------------------------------------ */

/* false when the path is too long for the system. */
static bool file_of(const struct droplet_disk *disk, const struct droplet_key *key, char path[static PATH_MAX], struct droplet_file *file)
{
	char name[DROPLET_NAME_SIZE];
	droplet_key_name(key, name);
	*file = (struct droplet_file){path, *key, disk->kernel_hash};
	return snprintf(path, PATH_MAX, "%s/%s", disk->directory, name) < PATH_MAX;
}

enum droplet_file_state droplet_disk_read(const struct droplet_disk *disk, const struct droplet_key *key, void **value)
{
	char path[PATH_MAX];
	struct droplet_file file;
	if (!file_of(disk, key, path, &file))
		return DROPLET_FILE_ABSENT;
	if (key->kind == DROPLET_TABLES) {
		struct droplet_tables *tables = NULL;
		enum droplet_file_state state = droplet_file_read_tables(&file, &tables);
		*value = tables;
		return state;
	}
	struct paper_fit_table *fit = malloc(sizeof *fit);
	enum droplet_file_state state = fit ? droplet_file_read_fit(&file, fit) : DROPLET_FILE_ABSENT;
	if (state != DROPLET_FILE_GOOD) {
		free(fit);
		fit = NULL;
	}
	*value = fit;
	return state;
}

struct found {
	char name[DROPLET_NAME_SIZE];
	struct timespec used;
	uint64_t bytes;
};

static int by_use(const void *a, const void *b)
{
	const struct timespec *x = &((const struct found *)a)->used, *y = &((const struct found *)b)->used;
	if (x->tv_sec != y->tv_sec)
		return x->tv_sec < y->tv_sec ? -1 : 1;
	return (x->tv_nsec > y->tv_nsec) - (x->tv_nsec < y->tv_nsec);
}

/* The files of ours in a directory; the caller frees. */
static struct found *list_files(DIR *stream, size_t *count)
{
	struct found *found = NULL;
	size_t room = *count = 0;
	for (struct dirent *entry; (entry = readdir(stream));) {
		struct stat status;
		if (fnmatch(DROPLET_NAME_PATTERN, entry->d_name, 0) != 0 || strlen(entry->d_name) >= DROPLET_NAME_SIZE ||
		    fstatat(dirfd(stream), entry->d_name, &status, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(status.st_mode))
			continue;
		if (*count == room) {
			struct found *grown = realloc(found, (room = 2 * room + 64) * sizeof *found);
			if (!grown)
				break;
			found = grown;
		}
		found[*count] = (struct found){.used = status.st_mtim, .bytes = 512 * (uint64_t)status.st_blocks};
		strcpy(found[(*count)++].name, entry->d_name);
	}
	return found;
}

/* Removes the files whose use is longest ago until the others take at most `bytes`. */
static void shrink_directory(const char *directory, uint64_t bytes)
{
	DIR *stream = opendir(directory);
	if (!stream)
		return;
	size_t count;
	uint64_t total = 0;
	struct found *found = list_files(stream, &count);
	for (size_t i = 0; i < count; i++)
		total += found[i].bytes;
	if (count > 0)
		qsort(found, count, sizeof *found, by_use);
	for (size_t i = 0; i < count && (total > bytes || count - i > FILES_MAX); i++) {
		unlinkat(dirfd(stream), found[i].name, 0);
		total -= found[i].bytes;
	}
	free(found);
	closedir(stream);
}

/* --- the thread ------------------------------------------------------------------------------------------------------------------- */

static bool write_value(const struct droplet_disk *disk, const struct task *task)
{
	char path[PATH_MAX];
	struct droplet_file file;
	size_t size = (droplet_file_bytes((enum droplet_kind)task->key.kind) + BLOCK - 1) / BLOCK * BLOCK;
	if (size > disk->bytes)
		return true; /* the bound leaves room for none: not a fault */
	if (!file_of(disk, &task->key, path, &file)) {
		errno = ENAMETOOLONG;
		return false;
	}
	if (!file_make_directories(disk->directory))
		return false;
	shrink_directory(disk->directory, disk->bytes - size);
	return task->key.kind == DROPLET_TABLES ? droplet_file_write_tables(&file, task->value)
						: droplet_file_write_fit(&file, task->value);
}

static void run_task(struct droplet_disk *disk, const struct task *task)
{
	char path[PATH_MAX];
	struct droplet_file file;
	if (!task->value) {
		if (file_of(disk, &task->key, path, &file))
			utimensat(AT_FDCWD, path, NULL, AT_SYMLINK_NOFOLLOW);
		return;
	}
	bool ok = write_value(disk, task);
	if (!ok && !disk->failing)
		log_warning("droplets: cannot be kept in %s, they are computed anew after a restart: %s", disk->directory, strerror(errno));
	disk->failing = !ok;
	disk->written(disk->context, task->value);
}

/* Waits for a task. false once closed and empty. */
static bool take_task(struct droplet_disk *disk, struct task *task)
{
	pthread_mutex_lock(&disk->mutex);
	while (disk->task_count == 0 && !disk->closed)
		pthread_cond_wait(&disk->changed, &disk->mutex);
	bool taken = disk->task_count > 0;
	if (taken) {
		*task = disk->tasks[0];
		memmove(&disk->tasks[0], &disk->tasks[1], (size_t)--disk->task_count * sizeof *task);
	}
	pthread_mutex_unlock(&disk->mutex);
	return taken;
}

static void *run_tasks(void *argument)
{
	struct droplet_disk *disk = argument;
	struct task task;
	file_replace_sweep(disk->directory, DROPLET_NAME_PATTERN);
	shrink_directory(disk->directory, disk->bytes);
	while (take_task(disk, &task))
		run_task(disk, &task);
	return NULL;
}

/* The longest waiting task makes room for a value, but not for a mark. Returns it; without a value when there is none. */
static struct task add_task(struct droplet_disk *disk, const struct task *task)
{
	struct task dropped = {0};
	pthread_mutex_lock(&disk->mutex);
	if (disk->task_count == TASKS_MAX && task->value) {
		dropped = disk->tasks[0];
		memmove(&disk->tasks[0], &disk->tasks[1], (size_t)--disk->task_count * sizeof dropped);
	}
	if (disk->task_count < TASKS_MAX)
		disk->tasks[disk->task_count++] = *task;
	pthread_cond_signal(&disk->changed);
	pthread_mutex_unlock(&disk->mutex);
	return dropped;
}

void droplet_disk_write(struct droplet_disk *disk, const struct droplet_key *key, const void *value)
{
	struct task dropped = add_task(disk, &(struct task){*key, value});
	if (!dropped.value)
		return;
	log_debug("droplets: the disk is behind, not all is kept");
	disk->written(disk->context, dropped.value);
}

void droplet_disk_touch(struct droplet_disk *disk, const struct droplet_key *key)
{
	add_task(disk, &(struct task){*key, NULL});
}

/* --- life ------------------------------------------------------------------------------------------------------------------------- */

struct droplet_disk *droplet_disk_create(const struct droplet_disk_params *params)
{
	struct droplet_disk *disk = calloc(1, sizeof *disk);
	if (!disk) {
		log_error("droplets: out of memory");
		return NULL;
	}
	/* A path that was cut is longer than the system takes, with a file's name behind it. */
	snprintf(disk->directory, sizeof disk->directory, "%s", params->directory);
	disk->bytes = params->bytes;
	disk->kernel_hash = params->kernel_hash;
	disk->written = params->written;
	disk->context = params->context;
	pthread_mutex_init(&disk->mutex, NULL);
	pthread_cond_init(&disk->changed, NULL);
	if (pthread_create(&disk->thread, NULL, run_tasks, disk) == 0)
		return disk;
	log_error("droplets: pthread_create failed");
	pthread_cond_destroy(&disk->changed);
	pthread_mutex_destroy(&disk->mutex);
	free(disk);
	return NULL;
}

void droplet_disk_destroy(struct droplet_disk *disk)
{
	if (!disk)
		return;
	pthread_mutex_lock(&disk->mutex);
	disk->closed = true;
	pthread_cond_signal(&disk->changed);
	pthread_mutex_unlock(&disk->mutex);
	pthread_join(disk->thread, NULL);
	pthread_cond_destroy(&disk->changed);
	pthread_mutex_destroy(&disk->mutex);
	free(disk);
}
