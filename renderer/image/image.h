/* Image files in memory, through OpenImageIO.
 *
 * OpenImageIO costs a process 0.17 s at start and some 126 MB, so it lives in a module of its own (build/stratus-image.so, the one C++ file
 * oiio.cpp) that image_module_load opens, beside the start of the GPU.
 */
#ifndef STRATUS_RENDERER_IMAGE_IMAGE_H
#define STRATUS_RENDERER_IMAGE_IMAGE_H

#include "renderer/image/picture_file.h"
#include "renderer/renderer.h"

#include <stdbool.h>
#include <stddef.h>

struct image_metadata {
	const char *scene_json; /* canonical scene, kept as "stratus:scene"; never NULL */
	const char *request_id; /* or NULL; not written to files (same scene, same bytes), for the log only */
	const char *software;   /* "stratus 0.4.0" */
	const char *comparison; /* figures of a comparison, JSON, kept as "stratus:comparison"; NULL: it is none */
};

/* One channel of an EXR that is put together from several pictures. */
struct image_plane {
	const char *name;    /* as in the file: "solved.flip.Y" */
	const float *values; /* of the upper left pixel, rows from the top */
	int stride;          /* values between neighbouring pixels */
};

struct image_planes {
	int width, height;
	const struct image_plane *plane;
	size_t count; /* from 1 */
};

struct image_buffer {
	unsigned char *data; /* malloc'd */
	size_t size;
};

/* Rows of a picture that is being read, from the top, each pixel grey, grey and alpha, RGB, or RGBA. Of a PNG codes over the largest code,
 * colour not multiplied by alpha; of an EXR the numbers as they are. */
struct image_rows {
	int first, count;
	int channels; /* 1..4 */
	const float *values;
};

/* false stops the reading. */
typedef bool image_rows_taker(void *context, const struct image_rows *rows);

/* Asked between rows of a picture that is being written. */
struct image_watch {
	bool (*is_over)(void *context); /* true stops the writing */
	void *context;
};

struct image_api {
	const char *version; /* of this module and the libraries that decide about an image's bytes */
	/* Encodes a frame as the scene's output asks (format, compression, type, bits). watch: NULL when nobody needs to be asked. Any
	 * thread, several at once. false and a message in `error` (at most error_size) on failure or when it was stopped; buffer->data is
	 * then NULL. */
	bool (*encode)(const struct frame *frame, const struct scene *scene, const struct image_metadata *metadata,
		       const struct image_watch *watch, struct image_buffer *buffer, char *error, size_t error_size);
	/* Encodes channels as an EXR, its type and compression those of the scene's output, its camera the scene's. Likewise. */
	bool (*encode_planes)(const struct image_planes *planes, const struct scene *scene, const struct image_metadata *metadata,
			      const struct image_watch *watch, struct image_buffer *buffer, char *error, size_t error_size);
	/* Reads the picture that picture_file_read found in an open file. Nothing but the reader of its format runs. Any thread, several at
	 * once. false and a message in `error` when the file is damaged or `take` stopped it. */
	bool (*decode)(int fd, const struct picture_file *file, image_rows_taker *take, void *context, char *error, size_t error_size);
};

/* Loads the module: from `path`, or when NULL from stratus-image.so beside the running program or in ../lib/stratus. NULL and a log line on
 * failure. Loads once; further calls return the same. Any thread. */
const struct image_api *image_module_load(const char *path);

#endif
