/* A pass: a GLSL function of a pixel, run over a rectangle of pixels into one or more textures.
 *
 * The file of a pass defines `void pass(ivec2 pixel)` and hands its results to STORE(i, vec4). The same text is wrapped as a fragment
 * program or as a compute program; texel row 0 is row 0 of the picture either way. Files may say #include "shaders/lib/NAME.glsl"; line
 * numbers in the driver's messages are those of the files. Every pass sees the uniform block of renderer/scene_block.h and `uniform vec4
 * arguments[4]`. Samplers are bound by their place in the list of names.
 *
 * The thread that owns the context calls.
 */
#ifndef STRATUS_RENDERER_GL_PASS_H
#define STRATUS_RENDERER_GL_PASS_H

#include "renderer/gl/texture.h"
#include "renderer/renderer.h"

enum { PASS_OUTPUTS_MAX = 8, PASS_SAMPLERS_MAX = 16, PASS_ARGUMENTS = 4 };

struct pass_desc {
	const char *file;                        /* "shaders/passes/NAME.glsl" */
	const char *defines;                     /* lines of #define, or NULL */
	int outputs;                             /* 1..PASS_OUTPUTS_MAX; 0 for a pass that writes buffers only (always compute) */
	const char *samplers[PASS_SAMPLERS_MAX]; /* names, in the order of the textures at pass_run */
	bool adds;                               /* STORE adds to what the targets hold, all of TEXTURE_RGBA32F */
};

struct pass_compiler {
	enum pass_kind kind;    /* PASS_FRAGMENT or PASS_COMPUTE */
	const char *shader_dir; /* NULL: embedded files */
	/* The renderer is: fragments get the scene block from the vertices, which is more than other devices hand on. */
	bool software;
};

struct pass;

/* Compiles and links. NULL after log lines with the driver's whole message. */
struct pass *pass_create(const struct pass_compiler *compiler, const struct pass_desc *desc);

/* Did a pass not compile or link, of the calling thread's, since this was asked last? */
bool pass_was_refused(void);
void pass_destroy(struct pass *pass);

struct pass_run {
	struct texture *const *targets; /* as many as the pass has outputs, all of one size; NULL after the first: not kept */
	int level;                      /* of the targets, 0 the largest */
	int width, height;              /* pixels to run; 0: the size of the targets at that level */
	int first_column, first_row;    /* where the pixels begin */
	const struct texture *samplers[PASS_SAMPLERS_MAX];
	float arguments[PASS_ARGUMENTS][4];
};

/* Was a pass run without a texture that its program reads (one log line each), since the calling thread asked last? What it drew then
 * depends on what others left bound, and is to be thrown away. */
bool pass_lacked_texture(void);

/* Runs. What later passes, copies and read-backs see of the targets is complete (barriers included). */
void pass_run(const struct pass *pass, const struct pass_run *run);

#endif
