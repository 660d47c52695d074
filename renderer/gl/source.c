#include "renderer/gl/source.h"

#include "renderer/embed.h"
#include "renderer/log.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool reserve(struct source *source, size_t more)
{
	if (source->failed)
		return false;
	if (source->length + more + 1 <= source->capacity)
		return true;
	const size_t capacity = 2 * (source->length + more + 1);
	char *text = realloc(source->text, capacity);
	if (!text) {
		log_error("shader: out of memory");
		source->failed = true;
		return false;
	}
	source->text = text;
	source->capacity = capacity;
	return true;
}

static void append(struct source *source, const char *text, size_t length)
{
	if (!reserve(source, length))
		return;
	memcpy(source->text + source->length, text, length);
	source->length += length;
	source->text[source->length] = 0;
}

void source_print(struct source *source, const char *format, ...)
{
	char line[1024];
	va_list args;
	va_start(args, format);
	const int length = vsnprintf(line, sizeof line, format, args);
	va_end(args);
	if (length > 0)
		append(source, line, (size_t)length < sizeof line ? (size_t)length : sizeof line - 1);
}

static char *read_whole(const char *path, size_t *size)
{
	char *data = NULL;
	FILE *file = fopen(path, "rb");
	if (!file)
		return NULL;
	long end = -1;
	if (fseek(file, 0, SEEK_END) == 0 && (end = ftell(file)) >= 0 && fseek(file, 0, SEEK_SET) == 0)
		data = malloc((size_t)end + 1);
	if (data)
		*size = fread(data, 1, (size_t)end, file);
	fclose(file);
	return data;
}

static bool append_lines(struct source *source, const char *shader_dir, const char *data, size_t size, int file_number)
{
	static const char include[] = "#include \"";
	int line_number = 1;
	for (const char *line = data, *end = data + size; line < end; line_number++) {
		const char *newline = memchr(line, '\n', (size_t)(end - line));
		const size_t length = newline ? (size_t)(newline - line) + 1 : (size_t)(end - line);
		if (length > sizeof include && memcmp(line, include, sizeof include - 1) == 0) {
			char name[64];
			snprintf(name, sizeof name, "%.*s", (int)strcspn(line + sizeof include - 1, "\"\n"), line + sizeof include - 1);
			if (!source_include(source, shader_dir, name))
				return false;
			source_print(source, "#line %d %d\n", line_number + 1, file_number);
		} else {
			append(source, line, length);
		}
		line += length;
	}
	return !source->failed;
}

bool source_include(struct source *source, const char *shader_dir, const char *file)
{
	for (int i = 0; i < source->file_count; i++)
		if (strcmp(source->files[i], file) == 0)
			return true;
	if (source->file_count == SOURCE_FILES_MAX) {
		log_error("shader: more than %d files included", SOURCE_FILES_MAX);
		return false;
	}
	const int number = source->file_count++;
	snprintf(source->files[number], sizeof source->files[number], "%s", file);

	const struct embedded_file *embedded = embedded_find(shader_files, file);
	char *from_disk = NULL;
	const char *data = embedded ? embedded->data : NULL;
	size_t size = embedded ? embedded->size : 0;
	if (shader_dir) {
		char path[4096];
		const char *name = strncmp(file, "shaders/", 8) == 0 ? file + 8 : file;
		snprintf(path, sizeof path, "%s/%s", shader_dir, name);
		data = from_disk = read_whole(path, &size);
	}
	if (!data) {
		log_error("shader: cannot read %s%s%s", shader_dir ? shader_dir : "", shader_dir ? ": " : "embedded ", file);
		return false;
	}
	source_print(source, "#line 1 %d\n", number);
	const bool ok = append_lines(source, shader_dir, data, size, number);
	free(from_disk);
	return ok;
}

void source_finish(struct source *source)
{
	free(source->text);
	*source = (struct source){0};
}
