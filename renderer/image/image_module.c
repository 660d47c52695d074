/* Finds and opens the image module. Once opened it stays: OpenImageIO keeps threads and static state that no unloading survives. */
#include "renderer/image/image.h"

#include "renderer/log.h"

#include <dlfcn.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const char *const places[] = {"stratus-image.so", "../lib/stratus/stratus-image.so"}; /* seen from the running program */

/* The first of the places that exists; false when none does. */
static bool find_module(char path[PATH_MAX])
{
	char folder[PATH_MAX];
	const ssize_t length = readlink("/proc/self/exe", folder, sizeof folder - 1);
	if (length < 0)
		return false;
	folder[length] = '\0';
	*strrchr(folder, '/') = '\0';
	for (size_t i = 0; i < sizeof places / sizeof *places; i++)
		if (snprintf(path, PATH_MAX, "%s/%s", folder, places[i]) < PATH_MAX && access(path, R_OK) == 0)
			return true;
	log_error("image module: neither %s nor %s found from %s", places[0], places[1], folder);
	return false;
}

static const struct image_api *open_module(const char *path)
{
	char found[PATH_MAX];
	if (!path) {
		if (!find_module(found))
			return NULL;
		path = found;
	}

	void *module = dlopen(path, RTLD_NOW | RTLD_LOCAL);
	if (!module) {
		log_error("image module: %s", dlerror());
		return NULL;
	}
	const struct image_api *(*entry)(void);
	*(void **)&entry = dlsym(module, "stratus_image_api"); /* the cast POSIX gives for function pointers */
	if (!entry) {
		log_error("image module: %s is none: %s", path, dlerror());
		dlclose(module);
		return NULL;
	}
	return entry();
}

const struct image_api *image_module_load(const char *path)
{
	static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
	static const struct image_api *loaded;

	pthread_mutex_lock(&mutex);
	if (!loaded)
		loaded = open_module(path);
	const struct image_api *api = loaded;
	pthread_mutex_unlock(&mutex);
	return api;
}
