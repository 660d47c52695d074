#include "renderer/gl/context.h"

#include "renderer/log.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct gl_context {
	EGLDisplay display;
	EGLContext context;
	struct gl_context_info info;
};

enum { DEVICES_MAX = 16 };

static void gl_forget_loss(void);

static bool has_word(const char *list, const char *word)
{
	const size_t length = strlen(word);
	for (const char *at = list; at && (at = strstr(at, word)); at += length)
		if ((at == list || at[-1] == ' ') && (at[length] == ' ' || at[length] == 0))
			return true;
	return false;
}

/* robust: a context that says when it was lost, to which an access out of bounds does no harm. Attributes of EGL 1.5, which
 * EGL_KHR_create_context shares but for the first. */
static EGLContext create_core_context(EGLDisplay display, bool robust)
{
	const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
				     4,
				     EGL_CONTEXT_MINOR_VERSION,
				     5,
				     EGL_CONTEXT_OPENGL_PROFILE_MASK,
				     EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
				     EGL_CONTEXT_OPENGL_DEBUG,
				     EGL_TRUE,
				     robust ? EGL_CONTEXT_OPENGL_ROBUST_ACCESS : EGL_NONE,
				     EGL_TRUE,
				     EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY,
				     EGL_LOSE_CONTEXT_ON_RESET,
				     EGL_NONE};
	return eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes);
}

static EGLContext create_best_context(EGLDisplay display, const char *platform, const char *extensions)
{
	EGLContext context = EGL_NO_CONTEXT;
	if (has_word(extensions, "EGL_EXT_create_context_robustness"))
		context = create_core_context(display, true);
	if (context != EGL_NO_CONTEXT)
		return context;
	log_debug("egl: %s: no robust context", platform);
	return create_core_context(display, false);
}

/* Initialises a display and makes a context on it current. Everything is undone on failure. */
static bool bring_up(struct gl_context *context, EGLDisplay display, const char *platform)
{
	EGLint major, minor;
	if (display == EGL_NO_DISPLAY || !eglInitialize(display, &major, &minor)) {
		log_warning("egl: %s: cannot initialise (0x%04x)", platform, eglGetError());
		return false;
	}
	const char *extensions = eglQueryString(display, EGL_EXTENSIONS);
	if (!has_word(extensions, "EGL_KHR_no_config_context") && !has_word(extensions, "EGL_MESA_configless_context")) {
		log_warning("egl: %s: no context without a configuration", platform);
		goto terminate;
	}
	if (!has_word(extensions, "EGL_KHR_surfaceless_context") || !eglBindAPI(EGL_OPENGL_API)) {
		log_warning("egl: %s: no surfaceless OpenGL", platform);
		goto terminate;
	}
	context->context = create_best_context(display, platform, extensions);
	if (context->context == EGL_NO_CONTEXT) {
		log_warning("egl: %s: no OpenGL 4.5 core context (0x%04x)", platform, eglGetError());
		goto terminate;
	}
	if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context->context)) {
		log_warning("egl: %s: cannot make the context current (0x%04x)", platform, eglGetError());
		goto destroy;
	}
	context->display = display;
	snprintf(context->info.platform, sizeof context->info.platform, "%s", platform);
	return true;

destroy:
	eglDestroyContext(display, context->context);
terminate:
	eglTerminate(display);
	context->context = EGL_NO_CONTEXT;
	return false;
}

static bool try_device(struct gl_context *context, EGLDeviceEXT device, int index)
{
	char platform[64];
	snprintf(platform, sizeof platform, "device %d", index);
	return bring_up(context, eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, device, NULL), platform);
}

/* software: whether to take software or hardware devices; wanted: one index, or negative for any. */
static bool try_devices(struct gl_context *context, int wanted, bool software)
{
	EGLDeviceEXT devices[DEVICES_MAX];
	EGLint count = 0;
	if (!eglQueryDevicesEXT(DEVICES_MAX, devices, &count))
		return false;
	for (int i = 0; i < count; i++) {
		const char *extensions = eglQueryDeviceStringEXT(devices[i], EGL_EXTENSIONS);
		const bool is_software = extensions && has_word(extensions, "EGL_MESA_device_software");
		if (wanted >= 0 ? i != wanted : is_software != software)
			continue;
		if (try_device(context, devices[i], i))
			return true;
	}
	if (wanted >= count)
		log_warning("egl: device %d asked for, but there are %d", wanted, count);
	return false;
}

static bool find_platform(struct gl_context *context, int device_index)
{
	const char *client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
	const bool devices = has_word(client, "EGL_EXT_platform_device") &&
			     (has_word(client, "EGL_EXT_device_enumeration") || has_word(client, "EGL_EXT_device_base"));
	if (!devices)
		log_warning("egl: no EGL_EXT_platform_device");
	if (device_index >= 0)
		return devices && try_devices(context, device_index, false);
	if (devices && try_devices(context, -1, false))
		return true;
	if (has_word(client, "EGL_MESA_platform_surfaceless") &&
	    bring_up(context, eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL), "surfaceless"))
		return true;
	return devices && try_devices(context, -1, true);
}

static void GLAPIENTRY debug_message(GLenum source, GLenum type, GLuint id, GLenum severity, GLsizei length, const GLchar *text,
				     const void *user)
{
	(void)id, (void)length, (void)user;
	/* The compiler's messages come with the info log, which is read whole. */
	if (severity == GL_DEBUG_SEVERITY_NOTIFICATION || source == GL_DEBUG_SOURCE_SHADER_COMPILER)
		return;
	const bool error = type == GL_DEBUG_TYPE_ERROR;
	log_line(error ? LOG_ERROR : severity == GL_DEBUG_SEVERITY_HIGH ? LOG_WARNING : LOG_DEBUG, "gl: %s", text);
}

static void read_info(struct gl_context_info *info)
{
	static const char *const software_names[] = {"llvmpipe", "softpipe", "swrast", "SwiftShader"};
	snprintf(info->vendor, sizeof info->vendor, "%s", (const char *)glGetString(GL_VENDOR));
	snprintf(info->renderer, sizeof info->renderer, "%s", (const char *)glGetString(GL_RENDERER));
	snprintf(info->version, sizeof info->version, "%s", (const char *)glGetString(GL_VERSION));
	for (size_t i = 0; i < sizeof software_names / sizeof *software_names; i++)
		info->software |= strstr(info->renderer, software_names[i]) != NULL;
	GLint strategy = 0;
	glGetIntegerv(GL_RESET_NOTIFICATION_STRATEGY, &strategy);
	info->tells_of_resets = strategy == GL_LOSE_CONTEXT_ON_RESET;
	glGetIntegerv(GL_MAX_TEXTURE_SIZE, &info->max_texture_size);
	glGetIntegerv(GL_MAX_DRAW_BUFFERS, &info->max_draw_buffers);
	glGetIntegerv(GL_MAX_IMAGE_UNITS, &info->max_image_units);
	glGetIntegerv(GL_MAX_TEXTURE_IMAGE_UNITS, &info->max_texture_units);
	glGetIntegerv(GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS, &info->max_work_group_invocations);
}

struct gl_context *gl_context_create(int device_index, bool require_gpu)
{
	struct gl_context *context = calloc(1, sizeof *context);
	if (!context)
		return NULL;
	if (!find_platform(context, device_index)) {
		log_error("egl: no OpenGL 4.5 context: neither the device platform nor Mesa surfaceless came up (the lines above say what "
			  "was tried)");
		goto fail;
	}
	gl_forget_loss();
	read_info(&context->info);
	log_info("gl: %s, %s, %s (%s%s%s)", context->info.vendor, context->info.renderer, context->info.version, context->info.platform,
		 context->info.software ? ", software" : "", context->info.tells_of_resets ? ", tells of resets" : "");
	if (context->info.software && require_gpu) {
		log_error("gl: %s renders on the processor, and --require-gpu refuses that", context->info.renderer);
		goto fail;
	}
	if (context->info.software)
		log_warning("gl: no GPU in use, rendering on the processor");
	glEnable(GL_DEBUG_OUTPUT);
	glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
	glDebugMessageCallback(debug_message, NULL);
	return context;

fail:
	gl_context_destroy(context);
	return NULL;
}

void gl_context_destroy(struct gl_context *context)
{
	if (!context)
		return;
	if (context->context != EGL_NO_CONTEXT) {
		eglMakeCurrent(context->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
		eglDestroyContext(context->display, context->context);
		eglTerminate(context->display);
		eglReleaseThread();
	}
	free(context);
}

const struct gl_context_info *gl_context_info(const struct gl_context *context)
{
	return &context->info;
}

static _Thread_local bool memory_error, other_error;
static _Thread_local enum gl_loss loss;

static void gl_forget_loss(void)
{
	loss = GL_NOT_LOST;
}

/* The status is that of a reset that goes on: told once, perhaps, and the context is lost for good. */
bool gl_was_reset(const char *what)
{
	static const char *const words[] = {[GL_LOST_GUILTY] = "by what was rendered in it",
					    [GL_LOST_INNOCENT] = "by another one",
					    [GL_LOST_UNKNOWN] = "nobody knows by what"};
	const GLenum status = loss ? GL_NO_ERROR : glGetGraphicsResetStatus();
	if (status == GL_NO_ERROR)
		return loss;
	loss = status == GL_GUILTY_CONTEXT_RESET     ? GL_LOST_GUILTY
	       : status == GL_INNOCENT_CONTEXT_RESET ? GL_LOST_INNOCENT
						     : GL_LOST_UNKNOWN;
	log_error("gl: context lost (%s), %s", what, words[loss]);
	return true;
}

bool gl_failed(const char *what)
{
	bool failed = gl_was_reset(what);
	memory_error = false;
	/* A lost context may report errors for ever: a bounded number of them is read. */
	for (int i = 0; i < 8; i++) {
		const GLenum error = glGetError();
		if (error == GL_NO_ERROR)
			break;
		memory_error |= error == GL_OUT_OF_MEMORY;
		other_error |= error != GL_OUT_OF_MEMORY;
		log_error("gl: error 0x%04x (%s)", error, what);
		failed = true;
	}
	return failed;
}

enum gl_loss gl_lost(void)
{
	return loss;
}

bool gl_failed_for_memory(void)
{
	return memory_error;
}

bool gl_failed_otherwise(void)
{
	const bool failed = other_error;
	other_error = false;
	return failed;
}
