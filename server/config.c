#include "server/config.h"

#include "renderer/log.h"
#include "server/key_file.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum option_type { OPTION_TEXT, OPTION_INTEGER, OPTION_FLAG, OPTION_CHOICE };

struct option {
	const char *name, *variable, *value_name, *help;
	enum option_type type;
	size_t offset;
	int low, high;              /* of an integer */
	const char *const *choices; /* ends with NULL */
};

static const char *const pass_names[] = {[PASS_AUTO] = "auto", [PASS_FRAGMENT] = "fragment", [PASS_COMPUTE] = "compute", NULL};
static const char *const level_names[] = {
	[LOG_ERROR] = "error", [LOG_WARNING] = "warning", [LOG_INFO] = "info", [LOG_DEBUG] = "debug", NULL};
static const char *const format_names[] = {[LOG_TEXT] = "text", [LOG_JSON] = "json", NULL};

#define AT(member) .offset = offsetof(struct config, member)

/* clang-format off */
static const struct option options[] = {
	{"--listen", "STRATUS_LISTEN", "HOST:PORT", "address to serve on; port 0: any free one",
	 OPTION_TEXT, AT(listen)},
	{"--state-dir", "STRATUS_STATE_DIR", "DIR", "where the daemon keeps files of its own",
	 OPTION_TEXT, AT(state_dir)},
	{"--kernel", "STRATUS_KERNEL", "FILE", "Mie kernel table (mie.kernel beside the program, then in the state directory)",
	 OPTION_TEXT, AT(kernel)},
	{"--device", "STRATUS_DEVICE", "N", "EGL device; -1: the first hardware device, else software",
	 OPTION_INTEGER, AT(device), .low = -1, .high = 1024},
	{"--require-gpu", "STRATUS_REQUIRE_GPU", NULL, "refuse to run on software rendering",
	 OPTION_FLAG, AT(require_gpu)},
	{"--pass", "STRATUS_PASS", "KIND", "how full-screen passes run: auto (measured), fragment, compute",
	 OPTION_CHOICE, AT(pass_kind), .choices = pass_names},
	{"--shader-dir", "STRATUS_SHADER_DIR", "DIR", "read shaders from here instead of the built-in ones",
	 OPTION_TEXT, AT(shader_dir)},
	{"--image-module", "STRATUS_IMAGE_MODULE", "FILE", "the module that writes images (stratus-image.so beside the program)",
	 OPTION_TEXT, AT(image_module)},
	{"--queue-length", "STRATUS_QUEUE_LENGTH", "N", "pictures that may be in work; more are answered 503",
	 OPTION_INTEGER, AT(queue_length), .low = 1, .high = 65536},
	{"--queue-mpixels", "STRATUS_QUEUE_MPIXELS", "M", "megapixels of pictures that may be in work; more are answered 503",
	 OPTION_INTEGER, AT(queue_mpixels), .low = 1, .high = 1048576},
	{"--memory-mb", "STRATUS_MEMORY_MB", "MB", "memory of pictures in work, frames and files; more are answered 503",
	 OPTION_INTEGER, AT(memory_mb), .low = 64, .high = 16777216},
	{"--picture-mpixels", "STRATUS_PICTURE_MPIXELS", "M", "size of one picture, in 2^20 pixels times layers; larger ones are answered 422",
	 OPTION_INTEGER, AT(picture_mpixels), .low = 1, .high = 64},
	{"--connections", "STRATUS_CONNECTIONS", "N", "connections at a time; requests on more are answered 503, but probes and metrics",
	 OPTION_INTEGER, AT(connections), .low = 1, .high = 65536},
	{"--connections-per-address", "STRATUS_CONNECTIONS_PER_ADDRESS", "N", "likewise of one client address, or IPv6 network of 64 bits",
	 OPTION_INTEGER, AT(connections_per_address), .low = 1, .high = 65536},
	{"--header-max-kb", "STRATUS_HEADER_MAX_KB", "KB", "request line and headers of a request; more are answered 431",
	 OPTION_INTEGER, AT(header_max_kb), .low = 1, .high = 1024},
	{"--body-max-kb", "STRATUS_BODY_MAX_KB", "KB", "body of a request, uploads apart; more is answered 413",
	 OPTION_INTEGER, AT(body_max_kb), .low = 1, .high = 65536},
	{"--read-timeout-s", "STRATUS_READ_TIMEOUT_S", "S", "for a request to come in, and more for every 16 KB of its body; then 408",
	 OPTION_INTEGER, AT(read_timeout_s), .low = 1, .high = 3600},
	{"--workers", "STRATUS_WORKERS", "N", "threads that encode images; 0: one for each processor",
	 OPTION_INTEGER, AT(workers), .low = 0, .high = 256},
	{"--timeout-ms", "STRATUS_TIMEOUT_MS", "MS", "deadline of requests that state none (X-Timeout-Ms)",
	 OPTION_INTEGER, AT(timeout_ms), .low = 1, .high = 3600000},
	{"--drain-s", "STRATUS_DRAIN_S", "S", "for accepted work to be done after a signal to end; what is left is then answered 503",
	 OPTION_INTEGER, AT(drain_s), .low = 0, .high = 3600},
	{"--cache-mb", "STRATUS_CACHE_MB", "MB", "memory of the renderer's stages on the GPU",
	 OPTION_INTEGER, AT(cache_mb), .low = 1, .high = 1048576},
	{"--recycle-mb", "STRATUS_RECYCLE_MB", "MB", "growth of memory, beside the caches, after which the renderer is made anew; 0: never",
	 OPTION_INTEGER, AT(recycle_mb), .low = 0, .high = 16777216},
	{"--golden-s", "STRATUS_GOLDEN_S", "S", "between two proofs that the renderer renders, when idle, and four times as long at most; 0: at the start alone",
	 OPTION_INTEGER, AT(golden_s), .low = 0, .high = 86400},
	{"--hang-ms", "STRATUS_HANG_MS", "MS", "without progress of the renderer after which the daemon ends, to be started anew",
	 OPTION_INTEGER, AT(hang_ms), .low = 100, .high = 3600000},
	{"--images-mb", "STRATUS_IMAGES_MB", "MB", "memory of finished images, to be answered again; 0: none are kept",
	 OPTION_INTEGER, AT(images_mb), .low = 0, .high = 1048576},
	{"--droplets-mb", "STRATUS_DROPLETS_MB", "MB", "memory of droplet tables, 16 MB for each distribution",
	 OPTION_INTEGER, AT(droplets_mb), .low = 16, .high = 1048576},
	{"--droplets-disk-mb", "STRATUS_DROPLETS_DISK_MB", "MB", "disk space of droplet tables in the state directory; 0: none",
	 OPTION_INTEGER, AT(droplets_disk_mb), .low = 0, .high = 16777216},
	{"--asset-max-mb", "STRATUS_ASSET_MAX_MB", "MB", "size of one uploaded picture; larger ones are answered 413",
	 OPTION_INTEGER, AT(asset_max_mb), .low = 1, .high = 4096},
	{"--asset-count", "STRATUS_ASSET_COUNT", "N", "uploaded pictures that may be kept; more are answered 507",
	 OPTION_INTEGER, AT(asset_count), .low = 0, .high = 65536},
	{"--assets-disk-mb", "STRATUS_ASSETS_DISK_MB", "MB", "disk space of uploaded pictures in the state directory; 0: none",
	 OPTION_INTEGER, AT(assets_disk_mb), .low = 0, .high = 16777216},
	{"--assets-mb", "STRATUS_ASSETS_MB", "MB", "memory of pictures as the renderer reads them",
	 OPTION_INTEGER, AT(assets_mb), .low = 1, .high = 1048576},
	{"--reference-mpaths", "STRATUS_REFERENCE_MPATHS", "M", "light paths of one picture of the model reference, in millions; more are answered 422",
	 OPTION_INTEGER, AT(reference_mpaths), .low = 1, .high = 1048576},
	{"--keys", "STRATUS_KEYS", "FILE", "file of the keys that requests must show; without it none are asked for",
	 OPTION_TEXT, AT(keys)},
	{"--open-metrics", "STRATUS_OPEN_METRICS", NULL, "/metrics needs no key",
	 OPTION_FLAG, AT(open_metrics)},
	{"--allow-anyone", "STRATUS_ALLOW_ANYONE", NULL, "serve without keys on an address that others than this machine reach",
	 OPTION_FLAG, AT(allow_anyone)},
	{"--tls-cert", "STRATUS_TLS_CERT", "FILE", "serve HTTPS with this certificate and chain, PEM",
	 OPTION_TEXT, AT(tls_cert)},
	{"--tls-key", "STRATUS_TLS_KEY", "FILE", "the private key of that certificate, PEM",
	 OPTION_TEXT, AT(tls_key)},
	{"--cors-origins", "STRATUS_CORS_ORIGINS", "LIST", "origins whose pages may read answers, such as https://example.org, with commas between them",
	 OPTION_TEXT, AT(cors_origins)},
	{"--log-level", "STRATUS_LOG_LEVEL", "LEVEL", "error, warning, info, debug",
	 OPTION_CHOICE, AT(log_level), .choices = level_names},
	{"--log-format", "STRATUS_LOG_FORMAT", "FORMAT", "text, json (an object a line)",
	 OPTION_CHOICE, AT(log_format), .choices = format_names},
	{0},
};
/* clang-format on */

static void *option_at(const struct option *option, struct config *config)
{
	return (char *)config + option->offset;
}

bool config_knows_variable(const char *name, size_t length)
{
	for (const struct option *option = options; option->name; option++)
		if (strlen(option->variable) == length && strncmp(option->variable, name, length) == 0)
			return true;
	return false;
}

static bool set_integer(const struct option *option, const char *text, int *target)
{
	char *end;
	errno = 0;
	long value = strtol(text, &end, 10);
	if (errno || end == text || *end || value < option->low || value > option->high)
		return false;
	*target = (int)value;
	return true;
}

static bool set_flag(const char *text, bool *target)
{
	static const char *const words[] = {"0", "false", "no", "1", "true", "yes", NULL};
	for (int i = 0; words[i]; i++)
		if (strcmp(words[i], text) == 0) {
			*target = i >= 3;
			return true;
		}
	return false;
}

static bool set_choice(const struct option *option, const char *text, int *target)
{
	for (int i = 0; option->choices[i]; i++)
		if (strcmp(option->choices[i], text) == 0) {
			*target = i;
			return true;
		}
	return false;
}

/* `source` is the flag or the variable, for the message. */
static bool set_option(const struct option *option, const char *text, const char *source, struct config *config)
{
	void *target = option_at(option, config);
	switch (option->type) {
	case OPTION_TEXT:
		if (*text) {
			*(const char **)target = text;
			return true;
		}
		fprintf(stderr, "stratusd: %s needs a value\n", source);
		return false;
	case OPTION_INTEGER:
		if (set_integer(option, text, target))
			return true;
		fprintf(stderr, "stratusd: %s must be a whole number from %d to %d, not '%s'\n", source, option->low, option->high, text);
		return false;
	case OPTION_FLAG:
		if (set_flag(text, target))
			return true;
		fprintf(stderr, "stratusd: %s must be 1 or 0, not '%s'\n", source, text);
		return false;
	case OPTION_CHOICE:
		if (set_choice(option, text, target))
			return true;
		fprintf(stderr, "stratusd: %s: '%s' is none of %s\n", source, text, option->help);
		return false;
	}
	return false;
}

static void print_value(const struct option *option, const struct config *config)
{
	const void *value = (const char *)config + option->offset;
	const char *text;
	switch (option->type) {
	case OPTION_TEXT:
		text = *(const char *const *)value;
		printf("%s", text ? text : "");
		break;
	case OPTION_INTEGER:
		printf("%d", *(const int *)value);
		break;
	case OPTION_FLAG:
		printf("%d", *(const bool *)value);
		break;
	case OPTION_CHOICE:
		printf("%s", option->choices[*(const int *)value]);
		break;
	}
}

void config_print(const struct config *config)
{
	for (const struct option *option = options; option->name; option++) {
		printf("%s=", option->variable);
		print_value(option, config);
		printf("\n");
	}
}

static void print_help(const struct config *defaults)
{
	printf("stratusd renders physically based cloudy skies on request, over HTTP.\n\nusage: stratusd [FLAG...]\n\n");
	for (const struct option *option = options; option->name; option++) {
		char flag[64];
		snprintf(flag, sizeof flag, "%s %s", option->name, option->value_name ? option->value_name : "");
		printf("  %-24s %s\n%27s%s [", flag, option->help, "", option->variable);
		print_value(option, defaults);
		printf("]\n");
	}
	printf("  --print-config           print the settings as environment variables and exit\n"
	       "  --check-config           print them, look whether the daemon could start so, and exit: 0 yes, 2 no\n"
	       "  --new-key NAME           print a new key and its line for the file of keys, and exit\n"
	       "  --version                print the version and exit\n"
	       "  --help                   print this and exit\n");
}

static void set_defaults(struct config *config)
{
	const char *state = getenv("XDG_STATE_HOME"), *home = getenv("HOME");
	*config = (struct config){
		.listen = "127.0.0.1:8080",
		.device = -1,
		.pass_kind = PASS_AUTO,
		.queue_length = 64,
		.queue_mpixels = 512,
		.memory_mb = 4096,
		.picture_mpixels = 64,
		.connections = 1024,
		.connections_per_address = 256,
		.header_max_kb = 32,
		.body_max_kb = 1024,
		.read_timeout_s = 20,
		.timeout_ms = 30000,
		.drain_s = 120,
		.cache_mb = 256,
		.recycle_mb = 2048,
		.golden_s = 60,
		.hang_ms = 60000,
		.images_mb = 256,
		.droplets_mb = 256,
		.droplets_disk_mb = 1024,
		.asset_max_mb = 64,
		.asset_count = 256,
		.assets_disk_mb = 1024,
		.assets_mb = 256,
		.reference_mpaths = 1024,
		.log_level = LOG_INFO,
		.log_format = LOG_TEXT,
	};
	if (state && *state == '/')
		snprintf(config->state_dir_buffer, sizeof config->state_dir_buffer, "%s/stratus", state);
	else
		snprintf(config->state_dir_buffer, sizeof config->state_dir_buffer, "%s/.local/state/stratus", home ? home : "");
	config->state_dir = config->state_dir_buffer;
}

static bool read_environment(struct config *config)
{
	for (const struct option *option = options; option->name; option++) {
		const char *text = getenv(option->variable);
		if (text && *text && !set_option(option, text, option->variable, config))
			return false;
	}
	return true;
}

/* Reads argv[*index] as "--name value" or "--name=value" and moves past it. */
static bool read_flag(int argc, char **argv, int *index, struct config *config)
{
	const char *flag = argv[(*index)++];
	for (const struct option *option = options; option->name; option++) {
		size_t length = strlen(option->name);
		if (strncmp(flag, option->name, length) != 0 || (flag[length] && flag[length] != '='))
			continue;
		if (flag[length] == '=')
			return set_option(option, flag + length + 1, option->name, config);
		if (option->type == OPTION_FLAG)
			return set_option(option, "1", option->name, config);
		if (*index < argc)
			return set_option(option, argv[(*index)++], option->name, config);
		fprintf(stderr, "stratusd: %s needs a value\n", option->name);
		return false;
	}
	fprintf(stderr, "stratusd: unknown flag '%s'; --help lists them\n", flag);
	return false;
}

enum config_result config_parse(int argc, char **argv, struct config *config)
{
	bool print = false, check = false;
	set_defaults(config);
	if (!read_environment(config))
		return CONFIG_BAD;
	for (int i = 1; i < argc;) {
		if (strcmp(argv[i], "--help") == 0) {
			set_defaults(config);
			print_help(config);
			return CONFIG_DONE;
		}
		if (strcmp(argv[i], "--version") == 0) {
			printf("stratus %s\n", RENDERER_VERSION);
			return CONFIG_DONE;
		}
		if (strcmp(argv[i], "--new-key") == 0)
			return i + 1 < argc && key_file_print_new(argv[i + 1]) ? CONFIG_DONE : CONFIG_BAD;
		if (strcmp(argv[i], "--print-config") == 0) {
			print = true;
			i++;
		} else if (strcmp(argv[i], "--check-config") == 0) {
			check = true;
			i++;
		} else if (!read_flag(argc, argv, &i, config)) {
			return CONFIG_BAD;
		}
	}
	if (check)
		return CONFIG_CHECK;
	if (print)
		config_print(config);
	return print ? CONFIG_DONE : CONFIG_RUN;
}
