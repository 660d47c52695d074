/* What a picture file of strangers says of itself, read without any library and before anything is decoded: its kind, size, and how much
 * memory a reader would need; and which parts of it a reader is to see. Any thread.
 */
#ifndef STRATUS_RENDERER_IMAGE_PICTURE_FILE_H
#define STRATUS_RENDERER_IMAGE_PICTURE_FILE_H

#include "renderer/scene.h"

#include <stddef.h>

enum { PICTURE_SIDE_MAX = 8192, PICTURE_MAGIC_SIZE = 8 };

/* Memory for rows that can only be decoded together: all of an interlaced PNG, a block or a row of tiles of an EXR. */
enum { PICTURE_ROWS_BYTES_MAX = 256 << 20 };

struct picture_piece {
	uint64_t offset, size;
};

struct picture_file {
	enum image_format format;
	int width, height; /* 1..PICTURE_SIDE_MAX */
	int row_block;     /* rows that are decoded together, from 1 */
	/* What its reader sees, one behind the other. Of a PNG the chunks of its picture alone, so that no text, profile or unknown chunk
	 * is unpacked. */
	struct picture_piece *pieces;
	size_t piece_count;
};

/* The format that the first PICTURE_MAGIC_SIZE bytes of a file tell; false when it is none of ours. */
bool picture_file_recognise(const unsigned char *magic, enum image_format *format);

/* Reads the headers of the first `size` bytes of an open file. false when it is no such picture or beyond the limits; `error` then says
 * why. picture_file_finish in any case. */
bool picture_file_read(int fd, uint64_t size, struct picture_file *file, char *error, size_t error_size);
void picture_file_finish(struct picture_file *file);

#endif
