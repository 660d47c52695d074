/* An uploaded picture: the headers by our own reader, and what passes it by the decoder behind. Standing limits make a bomb a message: what
 * is decoded here is kept to a size that a fuzzer can afford. */
#include "renderer/image/image.h"
#include "tests/fuzz/target.h"

#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

static void require_sound(const struct picture_file *file, uint64_t size)
{
	FUZZ_REQUIRE(file->width >= 1 && file->width <= PICTURE_SIDE_MAX);
	FUZZ_REQUIRE(file->height >= 1 && file->height <= PICTURE_SIDE_MAX);
	FUZZ_REQUIRE(file->row_block >= 1);
	FUZZ_REQUIRE(file->piece_count >= 1);
	for (size_t i = 0; i < file->piece_count; i++)
		FUZZ_REQUIRE(file->pieces[i].size <= size && file->pieces[i].offset <= size - file->pieces[i].size);
}

static const struct image_api *images;

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
	(void)argc;
	(void)argv;
	const char *module = getenv("STRATUS_IMAGE_MODULE");
	images = image_module_load(module ? module : "build/stratus-image.so");
	FUZZ_REQUIRE(images);
	return 0;
}

/* How much of the picture came: rows from the top, none twice. */
struct progress {
	const struct picture_file *file;
	int rows;
};

static bool take(void *context, const struct image_rows *rows)
{
	struct progress *progress = context;
	FUZZ_REQUIRE(rows->first == progress->rows && rows->count >= 1 && rows->channels >= 1 && rows->channels <= 4);
	progress->rows += rows->count;
	FUZZ_REQUIRE(progress->rows <= progress->file->height);
	const size_t count = (size_t)rows->count * (size_t)progress->file->width * (size_t)rows->channels;
	/* Read, so that memory behind the rows' end is found. */
	volatile float value;
	for (size_t i = 0; i < count; i++)
		value = rows->values[i];
	(void)value;
	return true;
}

static void decode(int fd, const struct picture_file *file)
{
	enum { PIXELS_MAX = 1 << 16 };
	char error[256] = "";
	struct progress progress = {file, 0};
	if (file->width * file->height > PIXELS_MAX)
		return;
	if (images->decode(fd, file, take, &progress, error, sizeof error))
		FUZZ_REQUIRE(progress.rows == file->height);
	else
		FUZZ_REQUIRE(*error);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct picture_file file = {0};
	char error[256] = "";
	const int fd = memfd_create("picture", MFD_CLOEXEC);
	FUZZ_REQUIRE(fd >= 0 && write(fd, data, size) == (ssize_t)size);
	if (picture_file_read(fd, size, &file, error, sizeof error)) {
		require_sound(&file, size);
		decode(fd, &file);
	} else {
		FUZZ_REQUIRE(*error && strlen(error) < sizeof error);
	}
	picture_file_finish(&file);
	close(fd);
	return 0;
}
