/* An OpenGL 4.5 core context without a window, through EGL.
 *
 * Bring-up order: the device platform (EGL_EXT_platform_device), hardware devices before software ones, or exactly the device asked for;
 * then Mesa's surfaceless platform. Each step that fails is logged with what was tried. The thread that creates the context owns it: it is
 * current there until gl_context_destroy.
 */
#ifndef STRATUS_RENDERER_GL_CONTEXT_H
#define STRATUS_RENDERER_GL_CONTEXT_H

#include <stdbool.h>

struct gl_context;

struct gl_context_info {
	char vendor[128], renderer[128], version[128]; /* strings of OpenGL */
	char platform[64];                             /* "device 0" or "surfaceless" */
	bool software;                                 /* renders on the processor */
	bool tells_of_resets;                          /* else nobody hears of a lost context but by errors */
	int max_texture_size;                          /* texels of one side */
	int max_draw_buffers;                          /* outputs of one fragment pass */
	int max_image_units;                           /* outputs of one compute pass */
	int max_texture_units;                         /* samplers of one pass */
	int max_work_group_invocations;
};

/* device_index: EGL device counted from 0, negative for the best there is. require_gpu refuses a software renderer. NULL on failure, after
 * log lines that name each thing tried. */
struct gl_context *gl_context_create(int device_index, bool require_gpu);
void gl_context_destroy(struct gl_context *context);

const struct gl_context_info *gl_context_info(const struct gl_context *context);

/* True when OpenGL has reported an error since the last call (logged with `what`), or the context was lost. Owner thread. */
bool gl_failed(const char *what);

/* True when the context was lost (logged with `what`). Leaves errors where they are. Owner thread. */
bool gl_was_reset(const char *what);

enum gl_loss { GL_NOT_LOST, GL_LOST_GUILTY, GL_LOST_INNOCENT, GL_LOST_UNKNOWN };

/* Not 0 once one of these has seen this thread's context lost, by whose fault as far as the driver knows: nothing rendered in it will come
 * out any more. gl_context_create begins anew. Owner thread. */
enum gl_loss gl_lost(void);

/* True when the error last seen by gl_failed was GL_OUT_OF_MEMORY. Owner thread. */
bool gl_failed_for_memory(void);

/* True when gl_failed has seen an error of another kind since this was asked last. Owner thread. */
bool gl_failed_otherwise(void);

#endif
