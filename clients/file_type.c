#include "clients/file_type.h"

#include <stddef.h>
#include <string.h>
#include <strings.h>

static const char *const pictures[] = {
	".png", ".exr", ".jpg",  ".jpeg", ".jpe", ".jp2", ".jxl", ".tif",  ".tiff", ".webp", ".gif",  ".hdr",
	".pic", ".bmp", ".ppm",  ".pgm",  ".pnm", ".pfm", ".tga", ".dpx",  ".svg",  ".avif", ".heic", ".apng",
	".mp4", ".m4v", ".webm", ".avi",  ".mov", ".mkv", ".mpg", ".mpeg", ".ogv",  ".flv",  ".wmv",
};

bool file_type_is_picture(const char *path)
{
	const char *dot = strrchr(path, '.');
	for (size_t i = 0; dot && i < sizeof pictures / sizeof *pictures; i++)
		if (strcasecmp(dot, pictures[i]) == 0)
			return true;
	return false;
}
