/* Uploaded pictures into numbers: the one place where bytes of strangers are decoded, and that in a process of its own: the daemon calls
 * decoder.h, which has the same functions. It gets an open file and gives back plain numbers. Rows are taken one strip at a time, so that
 * memory follows from what is kept and not from what is sent (renderer/image/picture_file.h bounds the strip). Any thread.
 *
 * Alpha multiplies a PNG; an EXR is so already, and its alpha is left out. As thickness a picture with colours counts by its luminance.
 */
#ifndef STRATUS_SERVER_ASSET_DECODE_H
#define STRATUS_SERVER_ASSET_DECODE_H

#include "renderer/image/image.h"
#include "renderer/scene_map.h"

enum asset_use {
	ASSET_THICKNESS, /* PNG linear; one channel */
	ASSET_ALBEDO,    /* PNG by the sRGB curve, EXR linear; Rec.709 red, green, blue taken for the three bands */
	ASSET_USE_COUNT
};

/* What is known of a picture once it was looked through. */
struct asset_facts {
	enum image_format format;
	int width, height;
	float lowest[ASSET_USE_COUNT], highest[ASSET_USE_COUNT]; /* of its values, by use */
	float mean_albedo[3];                                    /* red, green, blue */
};

/* Looks through the first `size` bytes of an open file. false when it is no picture that can be used; `error` then says why. */
bool asset_examine(const struct image_api *images, int fd, uint64_t size, struct asset_facts *facts, char *error, size_t error_size);

/* Reads such a file as a map of at most side x side values; larger pictures are averaged. hash: of its content. The caller holds the map.
 * NULL and a reason on failure. */
struct scene_map *asset_decode(const struct image_api *images, int fd, uint64_t size, enum asset_use use, int side,
			       const unsigned char hash[static SCENE_MAP_HASH_BYTES], char *error, size_t error_size);

#endif
