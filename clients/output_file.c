#include "clients/output_file.h"

#include "clients/client.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool write_all(int fd, const char *data, size_t size)
{
	while (size) {
		const ssize_t written = write(fd, data, size);
		if (written < 0 && errno == EINTR)
			continue;
		if (written <= 0)
			return false;
		data += written;
		size -= (size_t)written;
	}
	return true;
}

/* What the user's umask leaves of a new file; mkstemp alone would make it private. */
static mode_t new_file_mode(void)
{
	const mode_t mask = umask(0);
	umask(mask);
	return 0666 & ~mask;
}

/* Beside its final name; the caller frees *temporary. Below 0: errno says why, nothing was made. */
static int open_temporary(const char *path, mode_t mode, char **temporary)
{
	if (asprintf(temporary, "%s.XXXXXX", path) < 0) {
		*temporary = NULL;
		errno = ENOMEM;
		return -1;
	}
	const int fd = mkstemp(*temporary);
	if (fd < 0 || fchmod(fd, mode) == 0)
		return fd;
	const int error = errno;
	close(fd);
	unlink(*temporary);
	errno = error;
	return -1;
}

static bool replace_file(const char *path, mode_t mode, const void *data, size_t size)
{
	char *temporary;
	const int fd = open_temporary(path, mode, &temporary);
	bool done = fd >= 0 && write_all(fd, data, size);
	int error = errno;
	if (fd >= 0 && close(fd) != 0 && done) {
		done = false;
		error = errno;
	}
	if (done && rename(temporary, path) != 0) {
		done = false;
		error = errno;
	}
	if (!done && fd >= 0)
		unlink(temporary);
	free(temporary);
	errno = error;
	return done;
}

static bool write_directly(const char *path, const void *data, size_t size)
{
	const int fd = open(path, O_WRONLY | O_CLOEXEC);
	const bool done = fd >= 0 && write_all(fd, data, size);
	const int error = errno;
	if (fd >= 0)
		close(fd);
	errno = error;
	return done;
}

bool output_file_write(const char *path, const void *data, size_t size)
{
	struct stat status;
	bool done;
	if (strcmp(path, "-") == 0) {
		done = write_all(STDOUT_FILENO, data, size);
	} else if (stat(path, &status) != 0) {
		done = replace_file(path, new_file_mode(), data, size);
	} else if (S_ISREG(status.st_mode)) {
		char *target = realpath(path, NULL); /* a link stays a link */
		done = target && replace_file(target, status.st_mode & 0777, data, size);
		free(target);
	} else {
		done = write_directly(path, data, size);
	}
	if (!done)
		client_error("%s: %s", strcmp(path, "-") == 0 ? "standard output" : path, strerror(errno));
	return done;
}

char *output_file_begin(const char *path)
{
	char *temporary;
	const int fd = open_temporary(path, new_file_mode(), &temporary);
	if (fd >= 0) {
		close(fd);
		return temporary;
	}
	client_error("%s: %s", path, strerror(errno));
	free(temporary);
	return NULL;
}

bool output_file_end(char *temporary, const char *path, bool whole)
{
	if (!temporary)
		return !whole;
	const bool done = whole && rename(temporary, path) == 0;
	if (whole && !done)
		client_error("%s: %s", path, strerror(errno));
	if (!done)
		unlink(temporary);
	free(temporary);
	return done || !whole;
}

bool output_file_check(const char *path)
{
	struct stat status;
	if (strcmp(path, "-") == 0)
		return true;
	const bool there = stat(path, &status) == 0;
	if (there && !S_ISREG(status.st_mode)) {
		if (S_ISDIR(status.st_mode))
			errno = EISDIR;
		else if (access(path, W_OK) == 0)
			return true;
		client_error("%s: %s", path, strerror(errno));
		return false;
	}
	char *target = there ? realpath(path, NULL) : NULL, *temporary = output_file_begin(target ? target : path);
	free(target);
	return temporary && output_file_end(temporary, path, false);
}
