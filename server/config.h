/* Settings of the daemon: one table of flags, each with an environment variable. Flags win over the environment. */
#ifndef STRATUS_SERVER_CONFIG_H
#define STRATUS_SERVER_CONFIG_H

#include "renderer/renderer.h"

struct config {
	const char *listen;       /* HOST:PORT, [IPv6]:PORT; port 0: any free one */
	const char *state_dir;    /* never NULL after config_parse; made when first needed */
	const char *kernel;       /* file of the Mie kernel table; NULL: looked for */
	const char *shader_dir;   /* NULL: the embedded shaders */
	const char *image_module; /* NULL: beside the program */
	int device;               /* EGL device; -1: the first hardware device, else software */
	bool require_gpu;
	int pass_kind;        /* enum pass_kind */
	int queue_length;     /* 1..65536 */
	int workers;          /* 1..256; 0: as many as processors */
	int timeout_ms;       /* 1..3600000, when a request says none */
	int drain_s;          /* 0..3600; for accepted work at the end */
	int cache_mb;         /* 1..1048576 */
	int droplets_mb;      /* 16..1048576 */
	int droplets_disk_mb; /* 0..16777216; 0: nothing is kept on disk */
	int asset_max_mb;     /* 1..4096; one picture */
	int asset_count;      /* 0..65536; 0: no uploads */
	int assets_disk_mb;   /* 0..16777216; likewise */
	int assets_mb;        /* 1..1048576; decoded, in memory */
	int reference_mpaths; /* 1..1048576; millions of light paths of one picture by the reference */
	const char *keys;     /* file of keys (key_file.h); NULL: none are asked for */
	bool open_metrics;    /* /metrics needs none */
	bool allow_anyone;    /* without keys on an address that others reach */
	const char *tls_cert; /* PEM; both or neither */
	const char *tls_key;
	const char *cors_origins; /* as cors.h has them; NULL: none */
	int golden_s;             /* 0..86400; between golden renders, 0: none but at the start */
	int hang_ms;              /* 100..3600000; without progress of the renderer */
	int recycle_mb;           /* 0..16777216; growth of memory; 0: any */
	int log_level;            /* enum log_level */
	int log_format;           /* enum log_format */

	/* Limits (docs/operations.md). */
	int queue_mpixels;           /* 1..1048576; megapixels that may wait */
	int memory_mb;               /* 64..16777216; of pictures in work */
	int picture_mpixels;         /* 1..64; 2^20 pixels of one picture, layers counted apart */
	int connections;             /* 1..65536 */
	int connections_per_address; /* 1..65536 */
	int header_max_kb;           /* 1..1024 */
	int body_max_kb;             /* 1..65536; of a scene */
	int read_timeout_s;          /* 1..3600; for a request to be complete */

	int images_mb; /* 0..1048576; 0: finished images are not kept */

	char state_dir_buffer[4096]; /* holds the default of state_dir */
};

enum config_result { CONFIG_RUN, CONFIG_DONE, CONFIG_CHECK, CONFIG_BAD };

/* Reads environment and flags. CONFIG_DONE: --help, --version, --print-config or --new-key was answered on standard output. CONFIG_CHECK:
 * --check-config is asked for. CONFIG_BAD: standard error says what is wrong. Strings point into argv and the environment. Main thread,
 * before others exist. */
enum config_result config_parse(int argc, char **argv, struct config *config);

/* Prints the settings as environment variables on standard output. */
void config_print(const struct config *config);

/* Is this (length characters) the variable of a setting? */
bool config_knows_variable(const char *name, size_t length);

#endif
