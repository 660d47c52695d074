#include "renderer/image/picture_file.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const unsigned char png_magic[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
static const unsigned char exr_magic[] = {0x76, 0x2f, 0x31, 0x01};

/* A file's first bytes, and where complaints go. */
struct source {
	int fd;
	uint64_t size;
	char *error;
	size_t error_size;
};

__attribute__((format(printf, 2, 3))) static bool refuse(const struct source *source, const char *format, ...)
{
	va_list args;
	va_start(args, format);
	vsnprintf(source->error, source->error_size, format, args);
	va_end(args);
	return false;
}

static bool read_at(const struct source *source, uint64_t offset, void *bytes, size_t count)
{
	if (offset > source->size || count > source->size - offset)
		return false;
	return pread(source->fd, bytes, count, (off_t)offset) == (ssize_t)count;
}

static uint32_t big_endian(const unsigned char *b)
{
	return (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
}

static uint32_t little_endian(const unsigned char *b)
{
	return (uint32_t)b[3] << 24 | (uint32_t)b[2] << 16 | (uint32_t)b[1] << 8 | b[0];
}

static bool set_size(const struct source *source, int64_t width, int64_t height, struct picture_file *file)
{
	if (width < 1 || height < 1 || width > PICTURE_SIDE_MAX || height > PICTURE_SIDE_MAX)
		return refuse(source, "is %lld x %lld pixels: from 1 x 1 to %d x %d", (long long)width, (long long)height, PICTURE_SIDE_MAX,
			      PICTURE_SIDE_MAX);
	file->width = (int)width;
	file->height = (int)height;
	return true;
}

/* Rows that are decoded together, and how wide a reader makes them. */
static bool check_rows(const struct source *source, uint64_t width, uint64_t rows, uint64_t bytes_per_pixel, const char *what)
{
	if (rows * width * bytes_per_pixel <= PICTURE_ROWS_BYTES_MAX)
		return true;
	return refuse(source, "%s takes more than %d MB to read at its size", what, PICTURE_ROWS_BYTES_MAX >> 20);
}

/* --- PNG (ISO/IEC 15948) ---------------------------------------------------------------------------------------------------------- */

enum { PNG_HEADER_END = 8 + 25, PNG_CHUNKS_MAX = 100000 };

static bool png_read_header(const struct source *source, struct picture_file *file)
{
	static const int channels_of[] = {1, 0, 3, 3, 2, 0, 4}; /* by colour type; a palette becomes colours */
	unsigned char header[25];
	if (!read_at(source, 8, header, sizeof header) || big_endian(header) != 13 || memcmp(header + 4, "IHDR", 4) != 0)
		return refuse(source, "is a PNG without a header");
	const int depth = header[16], type = header[17], interlaced = header[20];
	if (type > 6 || channels_of[type] == 0)
		return refuse(source, "is a PNG of the unknown colour type %d", type);
	if (!set_size(source, big_endian(header + 8), big_endian(header + 12), file))
		return false;
	file->row_block = interlaced ? file->height : 1;
	/* A transparent colour may add a channel. */
	return check_rows(source, (uint64_t)file->width, (uint64_t)file->row_block,
			  (uint64_t)(channels_of[type] + 1) * (depth == 16 ? 2 : 1), "an interlaced PNG");
}

static bool png_is_needed(const unsigned char type[4])
{
	static const char needed[][5] = {"PLTE", "tRNS", "IDAT", "IEND"};
	for (size_t i = 0; i < sizeof needed / sizeof *needed; i++)
		if (memcmp(type, needed[i], 4) == 0)
			return true;
	return false;
}

static bool add_piece(const struct source *source, struct picture_file *file, uint64_t offset, uint64_t size)
{
	struct picture_piece *last = file->piece_count ? &file->pieces[file->piece_count - 1] : NULL;
	if (last && last->offset + last->size == offset) {
		last->size += size;
		return true;
	}
	/* Room for a power of two. */
	if ((file->piece_count & (file->piece_count - 1)) == 0) {
		const size_t room = file->piece_count ? 2 * file->piece_count : 1;
		struct picture_piece *grown = realloc(file->pieces, room * sizeof *grown);
		if (!grown)
			return refuse(source, "cannot be read: out of memory");
		file->pieces = grown;
	}
	file->pieces[file->piece_count++] = (struct picture_piece){offset, size};
	return true;
}

static bool png_choose_chunks(const struct source *source, struct picture_file *file)
{
	uint64_t at = PNG_HEADER_END;
	if (!add_piece(source, file, 0, PNG_HEADER_END))
		return false;
	for (int i = 0; i < PNG_CHUNKS_MAX; i++) {
		unsigned char head[8];
		if (!read_at(source, at, head, sizeof head))
			return refuse(source, "is a PNG that ends before its picture does");
		const uint64_t size = 12 + (uint64_t)big_endian(head);
		if (size > source->size - at)
			return refuse(source, "is a PNG that ends before its picture does");
		if (png_is_needed(head + 4) && !add_piece(source, file, at, size))
			return false;
		if (memcmp(head + 4, "IEND", 4) == 0)
			return true;
		at += size;
	}
	return refuse(source, "is a PNG of more than %d chunks", PNG_CHUNKS_MAX);
}

/* --- EXR (openexr.com, "OpenEXR File Layout") -------------------------------------------------------------------------------------- */

enum { EXR_HEADER_MAX = 1 << 20, EXR_NAME_MAX = 255, EXR_CHANNELS_MAX = 16 };
enum { EXR_TILED = 0x200, EXR_DEEP = 0x800, EXR_PARTS = 0x1000, EXR_KNOWN_FLAGS = 0x1e00 };

struct exr_header {
	unsigned char *bytes;
	size_t count, at;
	int64_t width, height;
	uint32_t tile_width, tile_height; /* 0: none */
	int channels, pixel_bytes, compression;
};

/* A text that ends with a NUL, at the place that is read; NULL when it does not. */
static const char *exr_name(struct exr_header *header, size_t end)
{
	const char *name = (const char *)header->bytes + header->at;
	const size_t room = end - header->at < EXR_NAME_MAX + 1 ? end - header->at : EXR_NAME_MAX + 1;
	const char *close = memchr(name, '\0', room);
	if (!close)
		return NULL;
	header->at += (size_t)(close - name) + 1;
	return name;
}

static bool exr_read_channels(const struct source *source, struct exr_header *header, size_t end)
{
	enum { PIXEL_HALF = 1, PIXEL_FLOAT = 2, CHANNEL_BYTES = 16 };
	const char *name;
	while ((name = exr_name(header, end)) && *name) {
		const unsigned char *channel = header->bytes + header->at;
		if (end - header->at < CHANNEL_BYTES)
			return refuse(source, "is an EXR with a broken list of channels");
		const uint32_t type = little_endian(channel);
		if (type != PIXEL_HALF && type != PIXEL_FLOAT)
			return refuse(source, "is an EXR with whole numbers in it: its channels must be half or float");
		if (little_endian(channel + 8) != 1 || little_endian(channel + 12) != 1)
			return refuse(source, "is an EXR with subsampled channels");
		header->pixel_bytes += type == PIXEL_HALF ? 2 : 4;
		if (++header->channels > EXR_CHANNELS_MAX)
			return refuse(source, "is an EXR of more than %d channels", EXR_CHANNELS_MAX);
		header->at += CHANNEL_BYTES;
	}
	return name || refuse(source, "is an EXR with a broken list of channels");
}

static bool exr_read_attribute(const struct source *source, struct exr_header *header, const char *name, size_t size)
{
	const unsigned char *value = header->bytes + header->at;
	if (strcmp(name, "dataWindow") == 0 && size == 16) {
		header->width = (int64_t)(int32_t)little_endian(value + 8) - (int32_t)little_endian(value) + 1;
		header->height = (int64_t)(int32_t)little_endian(value + 12) - (int32_t)little_endian(value + 4) + 1;
	} else if (strcmp(name, "compression") == 0 && size == 1) {
		header->compression = value[0];
	} else if (strcmp(name, "tiles") == 0 && size == 9) {
		header->tile_width = little_endian(value);
		header->tile_height = little_endian(value + 4);
	} else if (strcmp(name, "channels") == 0) {
		return exr_read_channels(source, header, header->at + size);
	}
	return true;
}

static bool exr_read_attributes(const struct source *source, struct exr_header *header)
{
	const char *name, *type;
	while ((name = exr_name(header, header->count)) && *name) {
		type = exr_name(header, header->count);
		if (!type || header->count - header->at < 4)
			break;
		const size_t size = little_endian(header->bytes + header->at);
		header->at += 4;
		if (size > header->count - header->at)
			break;
		const size_t end = header->at + size;
		if (!exr_read_attribute(source, header, name, size))
			return false;
		header->at = end;
	}
	return (name && !*name) || refuse(source, "is an EXR whose header does not end within %d kB", EXR_HEADER_MAX >> 10);
}

/* Rows that a compression packs together. */
static int exr_rows_of(int compression)
{
	static const int rows[] = {1, 1, 1, 16, 32, 16, 32, 32, 32, 256}; /* none, rle, zips, zip, piz, pxr24, b44, b44a, dwaa, dwab */
	return compression >= 0 && compression < (int)(sizeof rows / sizeof *rows) ? rows[compression] : 0;
}

static bool exr_has_tiles(const struct exr_header *header)
{
	return header->tile_width >= 1 && header->tile_height >= 1 && header->tile_width <= PICTURE_SIDE_MAX &&
	       header->tile_height <= PICTURE_SIDE_MAX;
}

/* A block as packed, and four floats a pixel as it is read. Readers make room for whole blocks and tiles, also where they stand out of the
 * picture. */
static bool exr_check_rows(const struct source *source, const struct exr_header *header, bool tiled, const struct picture_file *file)
{
	uint64_t width = (uint64_t)file->width;
	if (tiled)
		width = (width + header->tile_width - 1) / header->tile_width * header->tile_width;
	return check_rows(source, width, (uint64_t)file->row_block, (uint64_t)header->pixel_bytes + 16,
			  "an EXR of such channels and tiles");
}

static bool exr_use_header(const struct source *source, const struct exr_header *header, bool tiled, struct picture_file *file)
{
	const int rows = exr_rows_of(header->compression);
	if (header->channels == 0)
		return refuse(source, "is an EXR without channels");
	if (!set_size(source, header->width, header->height, file))
		return false;
	if (rows == 0)
		return refuse(source, "is an EXR of unknown compression");
	if (tiled && !exr_has_tiles(header))
		return refuse(source, "is an EXR whose tiles are not from 1 x 1 to %d x %d pixels", PICTURE_SIDE_MAX, PICTURE_SIDE_MAX);
	file->row_block = tiled ? (int)header->tile_height : rows;
	return exr_check_rows(source, header, tiled, file) && add_piece(source, file, 0, source->size);
}

static bool exr_read(const struct source *source, struct picture_file *file)
{
	unsigned char start[8];
	if (!read_at(source, 0, start, sizeof start))
		return refuse(source, "is an EXR without a header");
	const uint32_t version = little_endian(start + 4) & 0xff, flags = little_endian(start + 4) & ~0xffu;
	if (version != 2 || (flags & ~(uint32_t)EXR_KNOWN_FLAGS))
		return refuse(source, "is an EXR of an unknown version");
	if (flags & EXR_DEEP)
		return refuse(source, "is a deep EXR, which holds no plain picture");
	if (flags & EXR_PARTS)
		return refuse(source, "is an EXR of several parts: one is wanted");
	struct exr_header header = {
		.count = source->size < EXR_HEADER_MAX ? (size_t)source->size : EXR_HEADER_MAX, .at = 8, .compression = -1};
	header.bytes = malloc(header.count);
	const bool ok = header.bytes && read_at(source, 0, header.bytes, header.count) && exr_read_attributes(source, &header) &&
			exr_use_header(source, &header, flags & EXR_TILED, file);
	free(header.bytes);
	return ok;
}

/* ------------------------------------------------------------------------------------------------------------------------------------ */

bool picture_file_recognise(const unsigned char *magic, enum image_format *format)
{
	*format = memcmp(magic, png_magic, sizeof png_magic) == 0 ? IMAGE_PNG : IMAGE_EXR;
	return *format == IMAGE_PNG || memcmp(magic, exr_magic, sizeof exr_magic) == 0;
}

bool picture_file_read(int fd, uint64_t size, struct picture_file *file, char *error, size_t error_size)
{
	const struct source source = {fd, size, error, error_size};
	unsigned char magic[PICTURE_MAGIC_SIZE];
	*file = (struct picture_file){0};
	snprintf(error, error_size, "cannot be read");
	if (!read_at(&source, 0, magic, sizeof magic) || !picture_file_recognise(magic, &file->format))
		return refuse(&source, "is neither PNG nor EXR");
	if (file->format == IMAGE_EXR)
		return exr_read(&source, file);
	return png_read_header(&source, file) && png_choose_chunks(&source, file);
}

void picture_file_finish(struct picture_file *file)
{
	free(file->pieces);
	*file = (struct picture_file){0};
}
