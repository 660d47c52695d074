#include "renderer/file_replace.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <fnmatch.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

/* Behind the name of a file in the making, as mkstemp and as fnmatch want it. */
#define TEMPORARY_ENDING ".XXXXXX"
#define TEMPORARY_ANY    ".??????"

bool file_write_all(int fd, const void *bytes, size_t size)
{
	const char *byte = bytes;
	while (size > 0) {
		ssize_t written = write(fd, byte, size);
		if (written < 0 && errno != EINTR)
			return false;
		if (written > 0) {
			byte += written;
			size -= (size_t)written;
		}
	}
	return true;
}

static bool write_parts(int fd, const struct iovec *parts, int count)
{
	for (int i = 0; i < count; i++)
		if (!file_write_all(fd, parts[i].iov_base, parts[i].iov_len))
			return false;
	return true;
}

void file_sync_directory_of(const char *path)
{
	char directory[PATH_MAX];
	snprintf(directory, sizeof directory, "%s", path);
	char *slash = strrchr(directory, '/');
	if (slash)
		slash[slash == directory] = '\0';
	int fd = open(slash ? directory : ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	if (fd < 0)
		return;
	fsync(fd);
	close(fd);
}

int file_replace_begin(const char *path, char temporary[static PATH_MAX])
{
	if (snprintf(temporary, PATH_MAX, "%s" TEMPORARY_ENDING, path) >= PATH_MAX) {
		errno = ENAMETOOLONG;
		return -1;
	}
	int fd = mkostemp(temporary, O_CLOEXEC);
	/* The lock, which dies with the process, tells a file in the making from one that is left. */
	if (fd >= 0)
		flock(fd, LOCK_EX | LOCK_NB);
	return fd;
}

bool file_replace_finish(int fd, const char *temporary, const char *path)
{
	/* mkstemp makes the file private; what is kept here is not secret and may be read by a daemon under another user. */
	if (fchmod(fd, 0644) != 0 || fsync(fd) != 0 || rename(temporary, path) != 0)
		return false;
	file_sync_directory_of(path);
	return true;
}

bool file_replace(const char *path, const struct iovec *parts, int count)
{
	char temporary[PATH_MAX];
	int fd = file_replace_begin(path, temporary);
	if (fd < 0)
		return false;
	bool ok = write_parts(fd, parts, count) && file_replace_finish(fd, temporary, path);
	int error = errno;
	if (!ok)
		unlink(temporary);
	close(fd);
	errno = error;
	return ok;
}

static void remove_if_left(int directory, const char *name)
{
	int fd = openat(directory, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
	if (fd < 0)
		return;
	struct stat status;
	if (fstat(fd, &status) == 0 && S_ISREG(status.st_mode) && flock(fd, LOCK_EX | LOCK_NB) == 0)
		unlinkat(directory, name, 0);
	close(fd);
}

void file_replace_sweep(const char *directory, const char *pattern)
{
	char temporary[NAME_MAX];
	DIR *stream = opendir(directory);
	if (!stream)
		return;
	snprintf(temporary, sizeof temporary, "%s" TEMPORARY_ANY, pattern);
	for (struct dirent *entry; (entry = readdir(stream));)
		if (fnmatch(temporary, entry->d_name, 0) == 0)
			remove_if_left(dirfd(stream), entry->d_name);
	closedir(stream);
}

bool file_make_directories(const char *path)
{
	char part[PATH_MAX];
	if (snprintf(part, sizeof part, "%s", path) >= (int)sizeof part) {
		errno = ENAMETOOLONG;
		return false;
	}
	for (char *c = part; *c; c++) {
		if (*c != '/' || c == part)
			continue;
		*c = '\0';
		mkdir(part, 0755);
		*c = '/';
	}
	return mkdir(part, 0755) == 0 || errno == EEXIST;
}
