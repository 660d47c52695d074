#include "server/config_check.h"

#include "renderer/embed.h"
#include "renderer/image/image.h"
#include "renderer/log.h"
#include "server/access.h"
#include "server/api_keys.h"
#include "server/cors.h"
#include "server/http.h"
#include "server/kernel_file.h"
#include "server/tls.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

extern char **environ;

/* Of a path that is to be made: cuts it down to what exists of it. */
static void keep_what_exists(char path[static PATH_MAX])
{
	while (access(path, F_OK) != 0 && errno == ENOENT) {
		char *slash = strrchr(path, '/');
		if (!slash)
			strcpy(path, ".");
		else if (slash == path)
			strcpy(path, "/");
		else
			*slash = '\0';
	}
}

/* Tries: permissions say nothing of /proc, nor of a file system that is mounted to be read. Leaves nothing behind. */
static bool can_hold_files(const char *directory)
{
	char probe[PATH_MAX];
	if (snprintf(probe, sizeof probe, "%s/.stratus-check-XXXXXX", directory) >= (int)sizeof probe) {
		errno = ENAMETOOLONG;
		return false;
	}
	return mkdtemp(probe) && rmdir(probe) == 0;
}

static bool check_state_dir(const char *state_dir)
{
	char path[PATH_MAX];
	struct stat status;
	if (snprintf(path, sizeof path, "%s", state_dir) >= (int)sizeof path) {
		log_error("--state-dir: the name is too long");
		return false;
	}
	keep_what_exists(path);
	const bool found = stat(path, &status) == 0;
	if (found && !S_ISDIR(status.st_mode)) {
		log_error("--state-dir %s: %s is no directory", state_dir, path);
		return false;
	}
	if (!found || !can_hold_files(path)) {
		log_error("--state-dir %s: %s: %s", state_dir, path, strerror(errno));
		return false;
	}
	return true;
}

static bool check_kernel(const struct config *config)
{
	char path[PATH_MAX];
	if (kernel_file_find(config->kernel, config->state_dir, path)) {
		printf("# Mie kernel table: %s\n", path);
		return true;
	}
	if (config->kernel) {
		log_error("--kernel %s: cannot be used", config->kernel);
		return false;
	}
	printf("# Mie kernel table: computed at the start, into %s\n", config->state_dir);
	return true;
}

/* Their text is the compiler's to judge. */
static bool check_shaders(const char *shader_dir)
{
	bool good = true;
	for (const struct embedded_file *file = shader_files; shader_dir && file->name; file++) {
		char path[PATH_MAX];
		const char *name = file->name + strlen("shaders/");
		if (snprintf(path, sizeof path, "%s/%s", shader_dir, name) < (int)sizeof path && access(path, R_OK) == 0)
			continue;
		log_error("--shader-dir %s: %s: %s", shader_dir, name, strerror(errno));
		good = false;
	}
	return good;
}

static bool check_images(const char *image_module)
{
	const struct image_api *images = image_module_load(image_module);
	if (images)
		printf("# image module: %s\n", images->version);
	return images != NULL;
}

static bool check_keys(const char *path)
{
	struct api_keys *keys = path ? api_keys_create(path) : NULL;
	api_keys_destroy(keys);
	return !path || keys;
}

bool config_is_consistent(const struct config *config)
{
	bool good = cors_origins_are_valid(config->cors_origins);
	if (!config->tls_cert != !config->tls_key) {
		log_error("--tls-cert and --tls-key go together");
		good = false;
	}
	return access_settings_are_safe(config) && good;
}

static void warn_of_unknown_variables(void)
{
	static const char prefix[] = "STRATUS_";
	for (char **variable = environ; *variable; variable++) {
		const size_t length = strcspn(*variable, "=");
		if (strncmp(*variable, prefix, sizeof prefix - 1) == 0 && !config_knows_variable(*variable, length))
			log_warning("%.*s: no setting is called so", (int)length, *variable);
	}
}

bool config_check(const struct config *config)
{
	config_print(config);
	fflush(stdout); /* before the lines of the log */
	warn_of_unknown_variables();
	bool good = http_can_listen(config->listen);
	good &= check_state_dir(config->state_dir);
	good &= check_kernel(config);
	good &= check_shaders(config->shader_dir);
	good &= check_images(config->image_module);
	good &= config_is_consistent(config);
	good &= check_keys(config->keys);
	good &= !config->tls_cert || !config->tls_key || tls_check(config->tls_cert, config->tls_key);
	return good;
}
