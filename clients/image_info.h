/* What an image file says of itself: size, channels, and the attributes that the daemon writes. Pixels are not read. */
#ifndef STRATUS_CLIENTS_IMAGE_INFO_H
#define STRATUS_CLIENTS_IMAGE_INFO_H

#include <jansson.h>

/* The scene as it stands in the file, whose numbers would be longer or less exact when written anew. */
#define IMAGE_INFO_SCENE_TEXT "scene_text"

/* {"format": "png" or "exr", "width", "height", "channels": names or their number, "attributes": numbers, texts and lists of numbers by
 * name, "scene": the scene in it, and IMAGE_INFO_SCENE_TEXT, where there is one}. NULL after a message; the caller owns the reference. */
json_t *image_info_read(const char *path);

#endif
