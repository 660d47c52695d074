/* Faults of a GPU, its driver and the memory, injected into the daemon: linked with it into build/stratusd-faulty, and in no other program.
 *
 * `--faults DIR`, before all other flags, names a folder. A fault happens when there is a symbolic link of its name, which is looked for
 * where the fault would strike; it leads to a number (so that it is there whole from the first moment), and is gone once the fault has
 * happened.
 *
 *   gl-reset       N: the driver reports a reset, N + 1 questions for it later
 *   poison         WIDTH, as long as the link exists: the driver reports a reset after each texture of that width
 *   gl-error       the next question for errors is answered with one
 *   gl-memory      OpenGL has no memory for the next texture
 *   gl-full        WIDTH, as long as the link exists: OpenGL has no memory for textures wider than that
 *   host-memory    BYTES: the next allocation of at least so many fails
 *   encode         as long as the link exists: no picture can be written
 *   shader         the driver takes the next shader for one that does not compile
 *   hang           S: the next pass holds the thread up for so many seconds
 *   hold           as long as the link exists: the next pass waits, and a link `held` says that it does
 *   growth         MB: the context takes so much memory, until it is destroyed
 *   gone           as long as the link exists: no context comes up
 *   black          as long as the link exists: nothing is drawn
 *
 * The daemon's own code knows nothing of this: what it calls is replaced, OpenGL behind libepoxy's pointers, EGL likewise, and malloc() and
 * the reading of flags by the linker (--wrap).
 */
#include "renderer/image/image.h"
#include "server/config.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static const char *folder;

/* Is the fault to happen? Takes its number (0 where there is none). Without an allocation: malloc() asks too. */
static bool find(const char *name, double *number, bool once)
{
	char path[PATH_MAX], text[32] = "";
	if (!folder || snprintf(path, sizeof path, "%s/%s", folder, name) >= (int)sizeof path)
		return false;
	if (readlink(path, text, sizeof text - 1) <= 0)
		return false;
	*number = atof(text);
	return !once || unlink(path) == 0;
}

/* --- OpenGL ------------------------------------------------------------------------------------------------------------------------ */

/* libepoxy's pointers lead at first to functions that find the driver's, put them in their own place, and call what is there then. So each
 * has its place while it is called. Only the thread that renders calls. */
#define REAL(name)    static __typeof__(epoxy_##name) real_##name
#define RESTORE(name) epoxy_##name = real_##name
#define REPLACE(name) real_##name = epoxy_##name, epoxy_##name = faulty_##name

REAL(glGetGraphicsResetStatus);
REAL(glTextureStorage2D);
REAL(glGetError);
REAL(glGetShaderiv);
REAL(glUseProgram);
REAL(glDrawArrays);
REAL(glDispatchCompute);
REAL(eglCreateContext);
REAL(eglDestroyContext);

static bool memory_error;
static int questions = -1; /* until a reset is reported */
static char *grown;

static GLenum EPOXY_CALLSPEC faulty_glGetGraphicsResetStatus(void)
{
	double number;
	if (questions < 0 && find("gl-reset", &number, true))
		questions = (int)number;
	RESTORE(glGetGraphicsResetStatus);
	const GLenum status = real_glGetGraphicsResetStatus();
	REPLACE(glGetGraphicsResetStatus);
	return questions >= 0 && questions-- == 0 ? GL_GUILTY_CONTEXT_RESET : status;
}

static void EPOXY_CALLSPEC faulty_glTextureStorage2D(GLuint texture, GLsizei levels, GLenum format, GLsizei width, GLsizei height)
{
	double number;
	RESTORE(glTextureStorage2D);
	if (find("gl-memory", &number, true) || (find("gl-full", &number, false) && width > (GLsizei)number))
		memory_error = true;
	else
		real_glTextureStorage2D(texture, levels, format, width, height);
	REPLACE(glTextureStorage2D);
	if (find("poison", &number, false) && width == (GLsizei)number)
		questions = 0;
}

static GLenum EPOXY_CALLSPEC faulty_glGetError(void)
{
	double number;
	const bool injected = memory_error;
	memory_error = false;
	if (find("gl-error", &number, true))
		return GL_INVALID_OPERATION;
	RESTORE(glGetError);
	const GLenum error = real_glGetError();
	REPLACE(glGetError);
	return injected ? GL_OUT_OF_MEMORY : error;
}

static void wait_while_held(void)
{
	double number;
	char held[PATH_MAX];
	bool said = false;
	if (!folder || snprintf(held, sizeof held, "%s/held", folder) >= (int)sizeof held)
		return;
	for (; find("hold", &number, false); nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL))
		said = said || symlink("1", held) == 0;
	if (said)
		unlink(held);
}

static void EPOXY_CALLSPEC faulty_glGetShaderiv(GLuint shader, GLenum what, GLint *value)
{
	double number;
	RESTORE(glGetShaderiv);
	real_glGetShaderiv(shader, what, value);
	REPLACE(glGetShaderiv);
	if (what == GL_COMPILE_STATUS && find("shader", &number, true))
		*value = GL_FALSE;
}

static void EPOXY_CALLSPEC faulty_glUseProgram(GLuint program)
{
	double number;
	wait_while_held();
	if (find("hang", &number, true))
		nanosleep(&(struct timespec){.tv_sec = (time_t)number}, NULL);
	RESTORE(glUseProgram);
	real_glUseProgram(program);
	REPLACE(glUseProgram);
}

static void EPOXY_CALLSPEC faulty_glDrawArrays(GLenum mode, GLint first, GLsizei count)
{
	double number;
	RESTORE(glDrawArrays);
	if (!find("black", &number, false))
		real_glDrawArrays(mode, first, count);
	REPLACE(glDrawArrays);
	if (!grown && find("growth", &number, true)) {
		grown = malloc((size_t)number << 20);
		if (grown)
			memset(grown, 1, (size_t)number << 20);
	}
}

static void EPOXY_CALLSPEC faulty_glDispatchCompute(GLuint x, GLuint y, GLuint z)
{
	double number;
	RESTORE(glDispatchCompute);
	if (!find("black", &number, false))
		real_glDispatchCompute(x, y, z);
	REPLACE(glDispatchCompute);
}

static EGLContext EPOXY_CALLSPEC faulty_eglCreateContext(EGLDisplay display, EGLConfig config, EGLContext share, const EGLint *attributes)
{
	double number;
	if (find("gone", &number, false))
		return EGL_NO_CONTEXT;
	RESTORE(eglCreateContext);
	const EGLContext context = real_eglCreateContext(display, config, share, attributes);
	REPLACE(eglCreateContext);
	return context;
}

static EGLBoolean EPOXY_CALLSPEC faulty_eglDestroyContext(EGLDisplay display, EGLContext context)
{
	free(grown);
	grown = NULL;
	RESTORE(eglDestroyContext);
	const EGLBoolean ok = real_eglDestroyContext(display, context);
	REPLACE(eglDestroyContext);
	return ok;
}

/* --- what the linker wraps --------------------------------------------------------------------------------------------------------- */

enum config_result __real_config_parse(int argc, char **argv, struct config *config);
enum config_result __wrap_config_parse(int argc, char **argv, struct config *config);
const struct image_api *__real_image_module_load(const char *path);
const struct image_api *__wrap_image_module_load(const char *path);
void *__real_malloc(size_t size);
void *__wrap_malloc(size_t size);

/* Small allocations are not asked about: the question costs more than they do. */
enum { SMALL_BYTES = 4096 };

void *__wrap_malloc(size_t size)
{
	double number;
	if (size >= SMALL_BYTES && find("host-memory", &number, false) && (double)size >= number && find("host-memory", &number, true))
		return NULL;
	return __real_malloc(size);
}

static const struct image_api *real_images;

static bool faulty_encode(const struct frame *frame, const struct scene *scene, const struct image_metadata *metadata,
			  const struct image_watch *watch, struct image_buffer *buffer, char *error, size_t error_size)
{
	double number;
	if (!find("encode", &number, false))
		return real_images->encode(frame, scene, metadata, watch, buffer, error, error_size);
	snprintf(error, error_size, "told to fail");
	return false;
}

const struct image_api *__wrap_image_module_load(const char *path)
{
	static struct image_api images;
	real_images = __real_image_module_load(path);
	if (!real_images)
		return NULL;
	images = *real_images;
	images.encode = faulty_encode;
	return &images;
}

enum config_result __wrap_config_parse(int argc, char **argv, struct config *config)
{
	if (argc < 3 || strcmp(argv[1], "--faults") != 0)
		return __real_config_parse(argc, argv, config);
	folder = argv[2];
	REPLACE(glGetGraphicsResetStatus);
	REPLACE(glTextureStorage2D);
	REPLACE(glGetError);
	REPLACE(glGetShaderiv);
	REPLACE(glUseProgram);
	REPLACE(glDrawArrays);
	REPLACE(glDispatchCompute);
	REPLACE(eglCreateContext);
	REPLACE(eglDestroyContext);
	argv[2] = argv[0];
	return __real_config_parse(argc - 2, argv + 2, config);
}
