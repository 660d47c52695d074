#include "clients/manifest.h"

#include "clients/client.h"
#include "clients/output_file.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct manifest {
	char *path;
	FILE *file;
	json_t *entries; /* by name */
};

enum { LINE_FLAGS = JSON_COMPACT | JSON_REAL_PRECISION(9) };

static const char *name_of(const json_t *entry)
{
	return json_string_value(json_object_get(entry, "name"));
}

/* Lines that are none are left out: the last one of a run that was killed. Returns whether the file ends with a whole line. */
static bool read_lines(struct manifest *manifest)
{
	char *line = NULL;
	size_t room = 0;
	ssize_t length;
	bool whole = true;
	rewind(manifest->file);
	while ((length = getline(&line, &room, manifest->file)) > 0) {
		json_t *entry = json_loads(line, JSON_REJECT_DUPLICATES, NULL);
		if (name_of(entry))
			json_object_set(manifest->entries, name_of(entry), entry);
		json_decref(entry);
		whole = line[length - 1] == '\n';
	}
	free(line);
	return whole;
}

struct manifest *manifest_open(const char *path)
{
	struct manifest *manifest = calloc(1, sizeof *manifest);
	if (!manifest || !(manifest->path = strdup(path)) || !(manifest->entries = json_object())) {
		client_error("out of memory");
		manifest_close(manifest);
		return NULL;
	}
	manifest->file = fopen(path, "a+e");
	bool good = manifest->file != NULL;
	if (good && !read_lines(manifest))
		good = fputc('\n', manifest->file) != EOF;
	if (!good) {
		client_error("%s: %s", path, strerror(errno));
		manifest_close(manifest);
		manifest = NULL;
	}
	return manifest;
}

const json_t *manifest_find(const struct manifest *manifest, const char *name)
{
	return json_object_get(manifest->entries, name);
}

bool manifest_add(struct manifest *manifest, json_t *entry)
{
	const bool kept = name_of(entry) && json_object_set(manifest->entries, name_of(entry), entry) == 0;
	const bool written = kept && json_dumpf(entry, manifest->file, LINE_FLAGS) == 0 && fputc('\n', manifest->file) != EOF &&
			     fflush(manifest->file) == 0;
	json_decref(entry);
	if (!written)
		client_error("%s: %s", manifest->path, kept ? strerror(errno) : "out of memory");
	return written;
}

/* Appends a line to a text of *size bytes. */
static bool append_line(FILE *text, const json_t *entry)
{
	return !entry || (json_dumpf(entry, text, LINE_FLAGS) == 0 && fputc('\n', text) != EOF);
}

bool manifest_sort(struct manifest *manifest, const char *(*name)(const void *context, int i), const void *context, int count)
{
	char *bytes = NULL;
	size_t size = 0;
	FILE *text = open_memstream(&bytes, &size);
	json_t *others = json_copy(manifest->entries), *entry;
	const char *key;
	bool good = text && others;
	for (int i = 0; good && i < count; i++)
		json_object_del(others, name(context, i));
	json_object_foreach(others, key, entry) good = good && append_line(text, entry);
	for (int i = 0; good && i < count; i++)
		good = append_line(text, manifest_find(manifest, name(context, i)));
	if (text && fclose(text) != 0)
		good = false;
	if (!good)
		client_error("out of memory");
	good = good && output_file_write(manifest->path, bytes, size);
	json_decref(others);
	free(bytes);
	return good;
}

void manifest_close(struct manifest *manifest)
{
	if (!manifest)
		return;
	if (manifest->file)
		fclose(manifest->file);
	json_decref(manifest->entries);
	free(manifest->path);
	free(manifest);
}
