#include "server/key_file.h"

#include "renderer/log.h"
#include "server/number_text.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define HASH_PREFIX "sha256:"
#define LIMIT_MAX   1e9

enum { FILE_BYTES_MAX = 1 << 20 };

/* Where a line stands, for messages. */
struct place {
	const char *path;
	int line;
};

/* What others than keys are called in metrics. */
static const char reserved_name[] = "anonymous";

static bool name_is_valid(const char *name)
{
	static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.";
	const size_t length = strlen(name);
	return length >= 1 && length < KEY_NAME_SIZE && strspn(name, plain) == length && strcmp(name, reserved_name) != 0;
}

static bool fault(const struct place *place, const char *what)
{
	log_error("keys: %s:%d: %s", place->path, place->line, what);
	return false;
}

static bool read_hash(const struct place *place, const char *word, unsigned char hash[static API_KEY_HASH_BYTES])
{
	static const char hexadecimal[] = "0123456789abcdefABCDEF";
	const size_t prefix = sizeof HASH_PREFIX - 1;
	if (!word || strncmp(word, HASH_PREFIX, prefix) != 0 || strlen(word) != prefix + 2 * API_KEY_HASH_BYTES ||
	    strspn(word + prefix, hexadecimal) != 2 * API_KEY_HASH_BYTES)
		return fault(place, "behind the name stands " HASH_PREFIX " and 64 hexadecimal digits");
	for (int i = 0; i < API_KEY_HASH_BYTES; i++) {
		const char pair[] = {word[prefix + 2 * (size_t)i], word[prefix + 2 * (size_t)i + 1], '\0'};
		hash[i] = (unsigned char)strtoul(pair, NULL, 16);
	}
	return true;
}

static bool read_limit(const struct place *place, const char *word, struct key_line *line)
{
	static const char *const names[] = {"requests_per_minute=", "megapixels_per_minute="};
	double *const values[] = {&line->requests_per_minute, &line->megapixels_per_minute};
	for (int i = 0; i < 2; i++) {
		const size_t length = strlen(names[i]);
		if (strncmp(word, names[i], length) != 0)
			continue;
		if (isfinite(*values[i]))
			return fault(place, "a limit is said twice");
		if (!number_parse(word + length, values[i]) || !(*values[i] > 0 && *values[i] <= LIMIT_MAX))
			return fault(place, "a limit is a number above 0, at most 1e9");
		return true;
	}
	return fault(place, "behind the hash stand requests_per_minute= and megapixels_per_minute= alone");
}

static bool read_line(const struct place *place, char *text, struct key_file *file)
{
	static const char blanks[] = " \t\r\n";
	char *rest, *name = strtok_r(text, blanks, &rest);
	if (!name || *name == '#')
		return true;
	if (file->count == KEYS_MAX)
		return fault(place, "there are more than 256 keys");
	if (!name_is_valid(name))
		return fault(place, "a name has 1 to 32 letters, digits, '-', '_' and '.', and is not anonymous");
	struct key_line *line = &file->line[file->count];
	*line = (struct key_line){.requests_per_minute = INFINITY, .megapixels_per_minute = INFINITY};
	strcpy(line->name, name);
	for (size_t i = 0; i < file->count; i++)
		if (strcmp(file->line[i].name, name) == 0)
			return fault(place, "the name stands above already");
	if (!read_hash(place, strtok_r(NULL, blanks, &rest), line->hash))
		return false;
	for (size_t i = 0; i < file->count; i++)
		if (api_key_hashes_match(file->line[i].hash, line->hash))
			return fault(place, "the hash stands above already");
	for (const char *word; (word = strtok_r(NULL, blanks, &rest));)
		if (!read_limit(place, word, line))
			return false;
	file->count++;
	return true;
}

static bool may_be_used(const char *path, int fd)
{
	struct stat status;
	if (fstat(fd, &status) != 0 || !S_ISREG(status.st_mode) || status.st_size > FILE_BYTES_MAX) {
		log_error("keys: %s is no file of at most 1 MiB", path);
		return false;
	}
	if (status.st_mode & (S_IWGRP | S_IWOTH)) {
		log_error("keys: %s may be written by others than its owner: chmod go-w", path);
		return false;
	}
	if (status.st_mode & S_IROTH)
		log_warning("keys: %s may be read by everybody: chmod o-r", path);
	return true;
}

bool key_file_read(const char *path, struct key_file *file)
{
	struct place place = {.path = path};
	char *text = NULL;
	size_t room = 0;
	bool good = true;
	file->count = 0;
	const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK);
	FILE *stream = fd >= 0 ? fdopen(fd, "r") : NULL;
	if (!stream) {
		log_error("keys: %s: %s", path, strerror(errno));
		if (fd >= 0)
			close(fd);
		return false;
	}
	if (!may_be_used(path, fd)) {
		fclose(stream);
		return false;
	}
	for (ssize_t length; (length = getline(&text, &room, stream)) >= 0;) {
		place.line++;
		good &= strlen(text) == (size_t)length ? read_line(&place, text, file) : fault(&place, "the line holds a NUL");
	}
	good &= feof(stream) != 0;
	fclose(stream);
	free(text);
	return good;
}

bool key_file_print_new(const char *name)
{
	char key[API_KEY_SIZE];
	unsigned char hash[API_KEY_HASH_BYTES];
	if (!name_is_valid(name)) {
		fprintf(stderr, "stratusd: a name has 1 to 32 letters, digits, '-', '_' and '.', and is not %s\n", reserved_name);
		return false;
	}
	if (!api_key_make(key) || !api_key_hash(key, hash))
		return false;
	fprintf(stderr, "The key, for its holder; nothing else will ever show it again. Below, the line for the file of --keys.\n");
	printf("%s\n%s " HASH_PREFIX, key, name);
	for (int i = 0; i < API_KEY_HASH_BYTES; i++)
		printf("%02x", hash[i]);
	printf("\n");
	return true;
}
