/* What the tests of droplet tables share: the kernel table, a folder for each test, what is on standard error.
 *
 * Wants build/mie.kernel, or the file that STRATUS_KERNEL names.
 */
#ifndef STRATUS_TESTS_DROPLETS_COMMON_H
#define STRATUS_TESTS_DROPLETS_COMMON_H

#include "renderer/optics/droplet_storage.h"
#include "renderer/optics/kernel.h"

#include <dirent.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <cmocka.h>

/* How much longer than plain programs sanitized ones may take. */
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
#define SLOWDOWN 20
#else
#define SLOWDOWN 1
#endif

static struct kernel *kernel;
static char folder[] = "/tmp/stratus-droplets-XXXXXX";

static inline int make_folder(void **state)
{
	(void)state;
	memcpy(folder + sizeof folder - 7, "XXXXXX", 6);
	return mkdtemp(folder) ? 0 : -1;
}

static inline void for_each_file(void (*visit)(const char *path, void *context), void *context)
{
	DIR *stream = opendir(folder);
	for (struct dirent *entry; stream && (entry = readdir(stream));) {
		char path[PATH_MAX];
		snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
		if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0)
			visit(path, context);
	}
	if (stream)
		closedir(stream);
}

static inline void remove_path(const char *path, void *context)
{
	(void)context;
	remove(path);
}

static inline int remove_folder(void **state)
{
	(void)state;
	for_each_file(remove_path, NULL);
	return rmdir(folder);
}

static inline void count_path(const char *path, void *context)
{
	(void)path;
	++*(int *)context;
}

static inline int count_files(void)
{
	int count = 0;
	for_each_file(count_path, &count);
	return count;
}

/* CLOCK_MONOTONIC; the processor's time is steadier on a busy machine: CLOCK_THREAD_CPUTIME_ID, CLOCK_PROCESS_CPUTIME_ID. */
static inline double clock_ms(clockid_t clock)
{
	struct timespec now;
	clock_gettime(clock, &now);
	return (double)now.tv_sec * 1e3 + (double)now.tv_nsec * 1e-6;
}

/* 0..1, the same in every run. */
static inline double random_unit(void)
{
	static uint64_t state = 5;
	state = state * 6364136223846793005ULL + 1442695040888963407ULL;
	return (double)(state >> 11) * 0x1p-53;
}

/* Of the whole range, its edges included more often than chance would have it. */
static inline double random_between(double low, double high)
{
	double unit = random_unit();
	return unit < 0.1 ? low : unit > 0.9 ? high : low * pow(high / low, (unit - 0.1) / 0.8);
}

static inline struct scene_dsd random_dsd(void)
{
	struct scene_dsd dsd;
	do
		dsd = (struct scene_dsd){random_between(1, 5000), random_between(1, 20), random_between(1, 30)};
	while (scene_dsd_liquid_water(&dsd) > 5);
	return dsd;
}

static inline void assert_same_tables(const struct droplet_tables *a, const struct droplet_tables *b)
{
	struct iovec left[DROPLET_STORAGE_PARTS], right[DROPLET_STORAGE_PARTS];
	droplet_storage_parts((struct droplet_storage *)a, left);
	droplet_storage_parts((struct droplet_storage *)b, right);
	for (int i = 0; i < DROPLET_STORAGE_PARTS; i++) {
		assert_true(left[i].iov_len == right[i].iov_len);
		assert_true(memcmp(left[i].iov_base, right[i].iov_base, left[i].iov_len) == 0);
	}
	assert_int_equal(a->optics->angle_count, b->optics->angle_count);
	assert_int_equal(a->optics->forward_count, b->optics->forward_count);
	assert_int_equal(a->optics->moment_count, b->optics->moment_count);
}

/* Runs work with standard error in a file, then returns that as text, which the caller frees. */
static inline char *log_of(void (*work)(void *context), void *context)
{
	FILE *file = tmpfile();
	assert_non_null(file);
	fflush(stderr);
	int before = dup(STDERR_FILENO);
	dup2(fileno(file), STDERR_FILENO);
	work(context);
	fflush(stderr);
	dup2(before, STDERR_FILENO);
	close(before);
	long size = lseek(fileno(file), 0, SEEK_END);
	char *text = calloc(1, (size_t)size + 1);
	assert_non_null(text);
	assert_int_equal(pread(fileno(file), text, (size_t)size, 0), size);
	fclose(file);
	return text;
}

static inline int count_lines(const char *text, const char *word)
{
	int count = 0;
	for (const char *at = text; (at = strstr(at, word)); at += strlen(word))
		count++;
	return count;
}

/* Exit status of the program. */
static inline int load_kernel(void)
{
	const char *path = getenv("STRATUS_KERNEL");
	kernel = kernel_load(path ? path : "build/mie.kernel");
	return kernel ? 0 : 1;
}

#endif
