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

static bool write_all(int fd, const char *byte, size_t size)
{
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
		if (!write_all(fd, parts[i].iov_base, parts[i].iov_len))
			return false;
	return true;
}

/* Makes the rename last. What cannot be synced costs no more than the file. */
static void sync_directory_of(const char *path)
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

bool file_replace(const char *path, const struct iovec *parts, int count)
{
	char temporary[PATH_MAX];
	if (snprintf(temporary, sizeof temporary, "%s" TEMPORARY_ENDING, path) >= (int)sizeof temporary) {
		errno = ENAMETOOLONG;
		return false;
	}
	int fd = mkostemp(temporary, O_CLOEXEC);
	if (fd < 0)
		return false;
	/* The lock, which dies with the process, tells a file in the making from one that is left. */
	flock(fd, LOCK_EX | LOCK_NB);
	/* mkstemp makes the file private; what the renderer computes is not secret and may be read by a daemon under another user. */
	bool ok = fchmod(fd, 0644) == 0 && write_parts(fd, parts, count) && fsync(fd) == 0 && rename(temporary, path) == 0;
	int error = errno;
	if (!ok)
		unlink(temporary);
	close(fd);
	if (ok)
		sync_directory_of(path);
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
