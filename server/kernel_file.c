#include "server/kernel_file.h"

#include "renderer/file_replace.h"
#include "renderer/log.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* Known before the table is computed rather than after. */
static bool can_write(const char *directory)
{
	char inside[PATH_MAX];
	return snprintf(inside, sizeof inside, "%s/.", directory) < (int)sizeof inside && access(inside, W_OK | X_OK) == 0;
}

static const char *const places[] = {"mie.kernel", "../share/stratus/mie.kernel"}; /* seen from the running program */

/* The first of the places where something is. */
static bool near_program(char path[static PATH_MAX])
{
	ssize_t length = readlink("/proc/self/exe", path, PATH_MAX - 1);
	if (length <= 0)
		return false;
	path[length] = '\0';
	char *name = strrchr(path, '/') + 1;
	const size_t room = (size_t)(PATH_MAX - (name - path));
	for (size_t i = 0; i < sizeof places / sizeof *places; i++)
		if (snprintf(name, room, "%s", places[i]) < (int)room && access(path, R_OK) == 0)
			return true;
	return false;
}

static void report_progress(void *context, double done)
{
	int *tenths = context;
	if ((int)(done * 10) > *tenths) {
		*tenths = (int)(done * 10);
		log_info("Mie kernel table: %d %%", *tenths * 10);
	}
}

static struct kernel *generate(const char *path)
{
	int tenths = 0;
	log_info("Mie kernel table: computing it once, for %s", path);
	return kernel_generate(path, 0, report_progress, &tenths) ? kernel_load(path) : NULL;
}

struct kernel *kernel_file_open(const char *path, const char *state_dir)
{
	char buffer[PATH_MAX];
	struct kernel *kernel = NULL;
	if (path)
		kernel = kernel_load(path);
	else if (near_program(buffer))
		kernel = kernel_load(buffer);
	if (kernel)
		return kernel;

	if (!file_make_directories(state_dir) || snprintf(buffer, sizeof buffer, "%s/mie.kernel", state_dir) >= (int)sizeof buffer) {
		log_error("state directory %s: %s", state_dir, strerror(errno));
		return NULL;
	}
	if (access(buffer, R_OK) == 0)
		kernel = kernel_load(buffer);
	if (kernel)
		return kernel;
	if (!can_write(state_dir)) {
		log_error("state directory %s, for the Mie kernel table: %s", state_dir, strerror(errno));
		return NULL;
	}
	return generate(buffer);
}

static bool is_kernel(const char *path)
{
	struct kernel *kernel = access(path, R_OK) == 0 ? kernel_load(path) : NULL;
	kernel_destroy(kernel);
	return kernel != NULL;
}

bool kernel_file_find(const char *path, const char *state_dir, char found[static PATH_MAX])
{
	if (path)
		return snprintf(found, PATH_MAX, "%s", path) < PATH_MAX && is_kernel(path);
	if (near_program(found) && is_kernel(found))
		return true;
	return snprintf(found, PATH_MAX, "%s/mie.kernel", state_dir) < PATH_MAX && is_kernel(found);
}
