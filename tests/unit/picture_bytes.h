/* PNG and EXR files made byte by byte, true ones and false ones, for tests of what reads them. */
#ifndef STRATUS_TESTS_PICTURE_BYTES_H
#define STRATUS_TESTS_PICTURE_BYTES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

struct file_bytes {
	unsigned char *data;
	size_t size, room;
};

static inline void put(struct file_bytes *to, const void *data, size_t size)
{
	if (!to->data || to->size + size > to->room) {
		to->room = 2 * (to->size + size) + 16;
		to->data = realloc(to->data, to->room);
	}
	memcpy(to->data + to->size, data, size);
	to->size += size;
}

static inline void put_number(struct file_bytes *to, uint64_t number, int count, bool big_endian)
{
	for (int i = 0; i < count; i++) {
		const unsigned char byte = (unsigned char)(number >> 8 * (big_endian ? count - 1 - i : i));
		put(to, &byte, 1);
	}
}

static inline void bytes_finish(struct file_bytes *bytes)
{
	free(bytes->data);
	*bytes = (struct file_bytes){0};
}

/* --- PNG --------------------------------------------------------------------------------------------------------------------------- */

static inline uint32_t png_crc(const unsigned char *data, size_t size)
{
	uint32_t table[256], crc = 0xffffffff;
	for (uint32_t i = 0; i < 256; i++) {
		table[i] = i;
		for (int k = 0; k < 8; k++)
			table[i] = table[i] >> 1 ^ (table[i] & 1 ? 0xedb88320 : 0);
	}
	for (size_t i = 0; i < size; i++)
		crc = crc >> 8 ^ table[(crc ^ data[i]) & 255];
	return ~crc;
}

static inline void png_chunk(struct file_bytes *png, const char *type, const void *data, size_t size)
{
	put_number(png, size, 4, true);
	const size_t begin = png->size;
	put(png, type, 4);
	if (size)
		put(png, data, size);
	put_number(png, png_crc(png->data + begin, png->size - begin), 4, true);
}

static inline struct file_bytes png_begin(uint32_t width, uint32_t height, int depth, int type, bool interlaced)
{
	struct file_bytes png = {0}, header = {0};
	put(&png, "\x89PNG\r\n\x1a\n", 8);
	put_number(&header, width, 4, true);
	put_number(&header, height, 4, true);
	put_number(&header, (uint64_t)depth << 32 | (uint64_t)type << 24 | interlaced, 5, true);
	png_chunk(&png, "IHDR", header.data, header.size);
	bytes_finish(&header);
	return png;
}

/* zlib's format, stored: rows of row_bytes, each behind a filter byte of none. */
static inline struct file_bytes png_stored(const unsigned char *rows, size_t row_bytes, size_t height)
{
	struct file_bytes stream = {0};
	uint32_t a = 1, b = 0;
	put(&stream, "\x78\x01", 2);
	for (size_t y = 0; y < height; y++) {
		put_number(&stream, y + 1 == height, 1, false);
		put_number(&stream, row_bytes + 1, 2, false);
		put_number(&stream, ~(row_bytes + 1), 2, false);
		put_number(&stream, 0, 1, false);
		put(&stream, rows + y * row_bytes, row_bytes);
		for (size_t i = 0; i <= row_bytes; i++) {
			a = (a + (i ? rows[y * row_bytes + i - 1] : 0)) % 65521;
			b = (b + a) % 65521;
		}
	}
	put_number(&stream, (uint64_t)b << 16 | a, 4, true);
	return stream;
}

/* rows: as the depth and the colour type have them. */
static inline struct file_bytes png_of(uint32_t width, uint32_t height, int depth, int type, const void *rows)
{
	static const int channels[] = {1, 0, 3, 1, 2, 0, 4};
	struct file_bytes png = png_begin(width, height, depth, type, false);
	struct file_bytes stream = png_stored(rows, (width * (size_t)channels[type] * (size_t)depth + 7) / 8, height);
	png_chunk(&png, "IDAT", stream.data, stream.size);
	png_chunk(&png, "IEND", NULL, 0);
	bytes_finish(&stream);
	return png;
}

/* --- EXR --------------------------------------------------------------------------------------------------------------------------- */

enum { EXR_UINT, EXR_HALF_TYPE, EXR_FLOAT_TYPE };

struct exr_options {
	const char *channels; /* names of one letter, in alphabetical order */
	int type;             /* of all */
	int x, y;             /* of the first pixel */
	int sampling;         /* 0: 1 */
	uint32_t flags;
	int compression;
	uint32_t tile; /* side; 0: scan lines */
};

static inline void exr_attribute(struct file_bytes *exr, const char *name, const char *type, const struct file_bytes *value)
{
	put(exr, name, strlen(name) + 1);
	put(exr, type, strlen(type) + 1);
	put_number(exr, value->size, 4, false);
	put(exr, value->data, value->size);
}

static inline void exr_numbers(struct file_bytes *exr, const char *name, const char *type, const uint32_t *numbers, int count, int bytes)
{
	struct file_bytes value = {0};
	for (int i = 0; i < count; i++)
		put_number(&value, numbers[i], bytes, false);
	exr_attribute(exr, name, type, &value);
	bytes_finish(&value);
}

/* All in front of the table of offsets. */
static inline struct file_bytes exr_begin(uint32_t width, uint32_t height, const struct exr_options *options)
{
	struct file_bytes exr = {0}, list = {0};
	const uint32_t x = (uint32_t)options->x, y = (uint32_t)options->y, one = 0x3f800000;
	const uint32_t window[] = {x, y, x + width - 1, y + height - 1}, compression = (uint32_t)options->compression, order = 0;
	put(&exr, "\x76\x2f\x31\x01", 4);
	put_number(&exr, 2 | options->flags | (options->tile ? 0x200 : 0), 4, false);
	for (const char *c = options->channels; *c; c++) {
		const unsigned sampling = options->sampling ? (unsigned)options->sampling : 1;
		put(&list, (char[]){*c, 0}, 2);
		put_number(&list, (uint64_t)options->type, 4, false);
		put_number(&list, 0, 4, false);
		put_number(&list, sampling, 4, false);
		put_number(&list, sampling, 4, false);
	}
	put(&list, "", 1);
	exr_attribute(&exr, "channels", "chlist", &list);
	exr_numbers(&exr, "compression", "compression", &compression, 1, 1);
	exr_numbers(&exr, "dataWindow", "box2i", window, 4, 4);
	exr_numbers(&exr, "displayWindow", "box2i", window, 4, 4);
	exr_numbers(&exr, "lineOrder", "lineOrder", &order, 1, 1);
	exr_numbers(&exr, "pixelAspectRatio", "float", &one, 1, 4);
	exr_numbers(&exr, "screenWindowCenter", "v2f", (uint32_t[]){0, 0}, 2, 4);
	exr_numbers(&exr, "screenWindowWidth", "float", &one, 1, 4);
	if (options->tile) {
		struct file_bytes tiles = {0};
		put_number(&tiles, options->tile, 4, false);
		put_number(&tiles, options->tile, 4, false);
		put_number(&tiles, 0, 1, false);
		exr_attribute(&exr, "tiles", "tiledesc", &tiles);
		bytes_finish(&tiles);
	}
	put(&exr, "", 1);
	bytes_finish(&list);
	return exr;
}

/* Not compressed, floats; values: [row][channel in the list's order][column]. */
static inline struct file_bytes exr_of(uint32_t width, uint32_t height, const struct exr_options *options, const float *values)
{
	struct file_bytes exr = exr_begin(width, height, options);
	const size_t row = width * strlen(options->channels) * sizeof *values, first = exr.size + 8 * height;
	for (size_t i = 0; i < height; i++)
		put_number(&exr, first + i * (row + 8), 8, false);
	for (size_t i = 0; i < height; i++) {
		put_number(&exr, (uint32_t)options->y + i, 4, false);
		put_number(&exr, row, 4, false);
		put(&exr, (const unsigned char *)values + i * row, row);
	}
	return exr;
}

#endif
