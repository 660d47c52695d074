/* Pictures of strangers into numbers, by another process (decoder_process.h): whatever a file does to the libraries that read it, it does
 * to that one and is told from what it looks like here, a picture that cannot be used. Any thread; one picture at a time.
 *
 * The daemon itself reads the first bytes of a picture and no more. What comes back is checked: sizes, and that all numbers are finite.
 */
#ifndef STRATUS_SERVER_DECODER_H
#define STRATUS_SERVER_DECODER_H

#include "server/asset_decode.h"
#include "server/sandbox.h"

struct decoder_limits {
	struct sandbox_limits process;
	uint32_t wall_ms;
};

/* Enough for every picture within PICTURE_SIDE_MAX that is read at its size; memory for PICTURE_ROWS_BYTES_MAX, what its reader needs
 * beside it, and a map. */
extern const struct decoder_limits decoder_default_limits;

enum decoder_result {
	DECODER_OK,
	DECODER_REFUSED, /* `error` says why the picture cannot be used, as what follows "The picture" */
	DECODER_LATE,    /* the deadline passed */
	DECODER_FAILED   /* nothing wrong with the picture: the log has the reason */
};

struct decoder;

/* Starts no process yet. image_module: as in image_module_load; stays the caller's. NULL (and a log line) when out of memory. */
struct decoder *decoder_create(const char *image_module, const struct decoder_limits *limits);
/* Ends what is being decoded (DECODER_LATE), and decodes nothing more. Any thread, at any time. */
void decoder_give_up(struct decoder *decoder);
/* Ends the process. Takes NULL. */
void decoder_destroy(struct decoder *decoder);

/* asset_examine and asset_decode (asset_decode.h). deadline_ms: on the clock of clock_now_ms. */
enum decoder_result decoder_examine(struct decoder *decoder, int fd, uint64_t size, double deadline_ms, struct asset_facts *facts,
				    char *error, size_t error_size);
/* facts: of an earlier examination. *map is set with DECODER_OK alone. */
enum decoder_result decoder_read_map(struct decoder *decoder, int fd, uint64_t size, double deadline_ms, const struct asset_facts *facts,
				     enum asset_use use, int side, const unsigned char hash[static SCENE_MAP_HASH_BYTES],
				     struct scene_map **map, char *error, size_t error_size);

#endif
