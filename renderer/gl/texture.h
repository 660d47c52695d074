/* Two- and three-dimensional textures of known size and format. The thread that owns the context calls. */
#ifndef STRATUS_RENDERER_GL_TEXTURE_H
#define STRATUS_RENDERER_GL_TEXTURE_H

#include <stdbool.h>
#include <stddef.h>

enum texture_format { TEXTURE_R32F, TEXTURE_RG32F, TEXTURE_RGBA32F, TEXTURE_RGBA16F, TEXTURE_RGBA8, TEXTURE_RGBA16, TEXTURE_RG16 };

struct texture {
	unsigned id; /* OpenGL name, 0 when there is none */
	int width, height, levels;
	int depth; /* 0: two-dimensional */
	enum texture_format format;
};

enum texture_flags {
	TEXTURE_REPEAT = 1,   /* all directions; else clamped to the edge */
	TEXTURE_REPEAT_X = 2, /* columns repeat, rows are clamped */
	TEXTURE_NEAREST = 4,  /* no filtering; else linear, and linear between levels */
	TEXTURE_MIPMAPS = 8,  /* all levels down to 1 x 1 */
};

/* Allocates; contents undefined. false (and a log line) when OpenGL refuses. */
bool texture_init(struct texture *texture, int width, int height, enum texture_format format, int flags);

/* The same with a third dimension, filtered linearly along all three. flags: TEXTURE_REPEAT (all directions), TEXTURE_MIPMAPS. */
bool texture_init_3d(struct texture *texture, int width, int height, int depth, enum texture_format format, int flags);

/* Replaces level 0: rows of width x components floats, in three dimensions plane after plane. TEXTURE_RGBA8/16 take 0..1. */
void texture_upload(const struct texture *texture, const float *values);

/* Fills the other levels with box-filtered ones. */
void texture_build_mipmaps(const struct texture *texture);

/* One level as a texture of its own, repeating and unfiltered, over the same memory: so that it can be read while another level is written.
 * The caller finishes it, before or after the whole. */
struct texture texture_level(const struct texture *texture, int level);

/* Filtered linearly from here on. */
void texture_filter_linearly(struct texture *texture);

/* Bytes of all levels. */
size_t texture_bytes(const struct texture *texture);

/* Takes a zeroed texture; zeroes it. */
void texture_finish(struct texture *texture);

/* Sized internal format, as OpenGL calls it. */
unsigned texture_internal_format(enum texture_format format);

#endif
