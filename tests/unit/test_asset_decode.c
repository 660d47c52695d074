/* Uploaded pictures into numbers: every kind of PNG and EXR that is taken, what is refused and why, and that no lie in a file costs more
 * than a message. */
#include "picture_bytes.h"

#include "renderer/image/image.h"
#include "server/asset_decode.h"

#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

static const struct image_api *api;
static const unsigned char hash[SCENE_MAP_HASH_BYTES] = {7};

static int file_of(const struct file_bytes *bytes)
{
	const int fd = memfd_create("picture", MFD_CLOEXEC);
	assert_true(fd >= 0);
	assert_int_equal(write(fd, bytes->data, bytes->size), bytes->size);
	return fd;
}

/* Takes the bytes over. */
static struct asset_facts facts_of(struct file_bytes bytes)
{
	struct asset_facts facts;
	char error[256] = "";
	const int fd = file_of(&bytes);
	if (!asset_examine(api, fd, bytes.size, &facts, error, sizeof error))
		fail_msg("%s", error);
	close(fd);
	bytes_finish(&bytes);
	return facts;
}

static struct scene_map *map_of(struct file_bytes bytes, enum asset_use use, int side)
{
	char error[256] = "";
	const int fd = file_of(&bytes);
	struct scene_map *map = asset_decode(api, fd, bytes.size, use, side, hash, error, sizeof error);
	if (!map)
		fail_msg("%s", error);
	assert_memory_equal(map->hash, hash, sizeof hash);
	close(fd);
	bytes_finish(&bytes);
	return map;
}

static void assert_values(struct scene_map *map, int width, int height, int channels, const float *values)
{
	assert_int_equal(map->width, width);
	assert_int_equal(map->height, height);
	assert_int_equal(map->channels, channels);
	for (int i = 0; i < width * height * channels; i++)
		assert_float_equal(map->values[i], values[i], 1e-6);
	scene_map_release(map);
}

static void assert_refused(struct file_bytes bytes, const char *words)
{
	struct asset_facts facts;
	char error[256] = "";
	const int fd = file_of(&bytes);
	assert_false(asset_examine(api, fd, bytes.size, &facts, error, sizeof error));
	if (!strstr(error, words))
		fail_msg("\"%s\" does not say \"%s\"", error, words);
	struct scene_map *map = asset_decode(api, fd, bytes.size, ASSET_ALBEDO, 64, hash, error, sizeof error);
	assert_null(map);
	close(fd);
	bytes_finish(&bytes);
}

static double linear(double srgb)
{
	return srgb <= 0.04045 ? srgb / 12.92 : pow((srgb + 0.055) / 1.055, 2.4);
}

/* --- what is taken ----------------------------------------------------------------------------------------------------------------- */

/* Row 0 of a file is row 0 of the map, column 0 its column 0. */
static void test_grey(void **state)
{
	(void)state;
	static const unsigned char rows[] = {0, 51, 255, 102, 0, 0};
	static const float thickness[] = {0, 0.2f, 1, 0.4f, 0, 0};
	assert_values(map_of(png_of(3, 2, 8, 0, rows), ASSET_THICKNESS, 64), 3, 2, 1, thickness);
	float albedo[18];
	for (int i = 0; i < 18; i++)
		albedo[i] = (float)linear(thickness[i / 3]);
	assert_values(map_of(png_of(3, 2, 8, 0, rows), ASSET_ALBEDO, 64), 3, 2, 3, albedo);
	const struct asset_facts facts = facts_of(png_of(2, 1, 8, 0, rows + 1));
	assert_int_equal(facts.format, IMAGE_PNG);
	assert_int_equal(facts.width, 2);
	assert_int_equal(facts.height, 1);
	assert_float_equal(facts.lowest[ASSET_THICKNESS], 0.2, 1e-6);
	assert_float_equal(facts.highest[ASSET_THICKNESS], 1, 0);
	assert_float_equal(facts.lowest[ASSET_ALBEDO], linear(0.2), 1e-6);
	for (int band = 0; band < 3; band++)
		assert_float_equal(facts.mean_albedo[band], (linear(0.2) + 1) / 2, 1e-6);
}

static void test_depths(void **state)
{
	(void)state;
	static const unsigned char rows16[] = {0x12, 0x34, 0xff, 0xff};
	static const float values16[] = {0x1234 / 65535.0f, 1};
	assert_values(map_of(png_of(2, 1, 16, 0, rows16), ASSET_THICKNESS, 64), 2, 1, 1, values16);
	static const unsigned char rows1[] = {0xa0};
	static const float values1[] = {1, 0, 1};
	assert_values(map_of(png_of(3, 1, 1, 0, rows1), ASSET_THICKNESS, 64), 3, 1, 1, values1);
	static const unsigned char rows4[] = {0x3f};
	static const float values4[] = {0.2f, 1};
	assert_values(map_of(png_of(2, 1, 4, 0, rows4), ASSET_THICKNESS, 64), 2, 1, 1, values4);
}

static void test_colours_and_alpha(void **state)
{
	(void)state;
	static const unsigned char rgb[] = {255, 0, 51, 51, 51, 51};
	const float luminance[] = {0.2126f + 0.0722f * 0.2f, 0.2f};
	assert_values(map_of(png_of(2, 1, 8, 2, rgb), ASSET_THICKNESS, 64), 2, 1, 1, luminance);
	const float l = (float)linear(0.2), albedo[] = {1, 0, l, l, l, l};
	assert_values(map_of(png_of(2, 1, 8, 2, rgb), ASSET_ALBEDO, 64), 2, 1, 3, albedo);

	static const unsigned char rgba[] = {255, 255, 255, 51, 51, 51, 51, 255};
	const float covered[] = {0.2f, 0.2f}, covered_albedo[] = {0.2f, 0.2f, 0.2f, l, l, l};
	assert_values(map_of(png_of(2, 1, 8, 6, rgba), ASSET_THICKNESS, 64), 2, 1, 1, covered);
	assert_values(map_of(png_of(2, 1, 8, 6, rgba), ASSET_ALBEDO, 64), 2, 1, 3, covered_albedo);
	static const unsigned char grey_alpha[] = {255, 102, 51, 255};
	const float covered_grey[] = {0.4f, 0.2f};
	assert_values(map_of(png_of(2, 1, 8, 4, grey_alpha), ASSET_THICKNESS, 64), 2, 1, 1, covered_grey);
}

static void test_palette(void **state)
{
	(void)state;
	struct file_bytes png = png_begin(2, 1, 8, 3, false), stream = png_stored((const unsigned char *)"\1\0", 2, 1);
	png_chunk(&png, "PLTE", "\0\0\0\xff\x33\x33", 6);
	png_chunk(&png, "IDAT", stream.data, stream.size);
	png_chunk(&png, "IEND", NULL, 0);
	bytes_finish(&stream);
	const float l = (float)linear(0.2), albedo[] = {1, l, l, 0, 0, 0};
	assert_values(map_of(png, ASSET_ALBEDO, 64), 2, 1, 3, albedo);
}

static void test_exr(void **state)
{
	(void)state;
	static const float bgr[] = {0.3f, 0.03f, 0.2f, 0.02f, 0.1f, 0.01f};
	static const float rgb[] = {0.1f, 0.2f, 0.3f, 0.01f, 0.02f, 0.03f};
	/* A window that does not begin at the origin changes nothing. */
	const struct exr_options colours = {.channels = "BGR", .type = EXR_FLOAT_TYPE, .x = -5, .y = 17};
	assert_values(map_of(exr_of(2, 1, &colours, bgr), ASSET_ALBEDO, 64), 2, 1, 3, rgb);

	/* Alpha first in the file; the colours hold it already. */
	static const float abgr[] = {0.5f, 0.5f, 0.3f, 0.03f, 0.2f, 0.02f, 0.1f, 0.01f};
	assert_values(map_of(exr_of(2, 1, &(struct exr_options){.channels = "ABGR", .type = EXR_FLOAT_TYPE}, abgr), ASSET_ALBEDO, 64), 2, 1,
		      3, rgb);

	static const float single[] = {0.25f, 0.5f, 0.75f, 1};
	for (const char *const *name = (const char *const[]){"Y", "H", "R", NULL}; *name; name++) {
		const struct exr_options options = {.channels = *name, .type = EXR_FLOAT_TYPE};
		assert_values(map_of(exr_of(2, 2, &options, single), ASSET_THICKNESS, 64), 2, 2, 1, single);
	}
	static const float outside[] = {-0.5f, 3};
	const struct asset_facts facts = facts_of(exr_of(2, 1, &(struct exr_options){.channels = "Y", .type = EXR_FLOAT_TYPE}, outside));
	assert_int_equal(facts.format, IMAGE_EXR);
	assert_float_equal(facts.lowest[ASSET_THICKNESS], -0.5, 0);
	assert_float_equal(facts.highest[ASSET_ALBEDO], 3, 0);
}

/* Larger pictures are averaged, in linear light. */
static void test_averaged(void **state)
{
	(void)state;
	static const unsigned char rows[] = {0, 255, 51, 51, 255, 0, 51, 51};
	const float thickness[] = {0.5f, 0.2f}, l = (float)linear(0.2);
	assert_values(map_of(png_of(4, 2, 8, 0, rows), ASSET_THICKNESS, 2), 2, 2, 1,
		      (const float[]){thickness[0], thickness[1], thickness[0], thickness[1]});
	assert_values(map_of(png_of(4, 2, 8, 0, rows), ASSET_ALBEDO, 1), 1, 1, 3,
		      (const float[]){(0.5f + l) / 2, (0.5f + l) / 2, (0.5f + l) / 2});
}

/* What is not the picture is never unpacked: neither a text of many megabytes nor one that is damaged. */
static void test_other_chunks_are_passed_over(void **state)
{
	(void)state;
	static const unsigned char rows[] = {51};
	struct file_bytes stream = png_stored(rows, 1, 1), png = png_begin(1, 1, 8, 0, false);
	const size_t large = 24 << 20;
	char *text = calloc(1, large);
	memcpy(text, "key\0\0\0\0\0", 8);
	png_chunk(&png, "iTXt", text, large);
	png_chunk(&png, "zTXt", "key\0\0\x78\x9cnot deflated", 19);
	png_chunk(&png, "iCCP", "profile\0\0\x78\x9cneither", 18);
	png_chunk(&png, "IDAT", stream.data, 3);
	png_chunk(&png, "IDAT", stream.data + 3, stream.size - 3);
	png_chunk(&png, "tEXt", "key\0value", 9);
	png_chunk(&png, "IEND", NULL, 0);
	png.data[png.size - 12 - 4 - 4] ^= 1; /* a text with a wrong sum */
	assert_values(map_of(png, ASSET_THICKNESS, 64), 1, 1, 1, (const float[]){0.2f});
	bytes_finish(&stream);
	free(text);
}

/* --- what is refused ---------------------------------------------------------------------------------------------------------------- */

static struct file_bytes copy_of(const char *data, size_t size)
{
	struct file_bytes bytes = {0};
	put(&bytes, data, size);
	return bytes;
}

static void test_other_files(void **state)
{
	(void)state;
	enum image_format format;
	assert_false(picture_file_recognise((const unsigned char *)"GIF89a..", &format));
	assert_false(picture_file_recognise((const unsigned char *)"\x89PNG\n\n\x1a\n", &format));
	assert_false(picture_file_recognise((const unsigned char *)"\xff\xd8\xff\xe0\0\x10JF", &format));
	assert_true(picture_file_recognise((const unsigned char *)"\x76\x2f\x31\x01....", &format));
	assert_int_equal(format, IMAGE_EXR);
	assert_refused(copy_of("P6\n1 1\n255\nabc", 14), "neither PNG nor EXR");
	assert_refused(copy_of("", 0), "neither PNG nor EXR");
	assert_refused(copy_of("\x89PNG\r\n\x1a\n", 8), "without a header");
	assert_refused(copy_of("\x76\x2f\x31\x01\2\0\0\0", 8), "header does not end");
}

static void test_sizes_that_are_too_large(void **state)
{
	(void)state;
	struct file_bytes png = png_begin(100000, 100000, 8, 6, false);
	png_chunk(&png, "IEND", NULL, 0);
	assert_refused(png, "100000 x 100000");
	png = png_begin(8193, 1, 8, 0, false);
	assert_refused(png, "8192");
	assert_refused(png_begin(0, 1, 8, 0, false), "from 1 x 1");
	assert_refused(png_begin(1, 0x80000000u, 8, 0, false), "from 1 x 1");
	assert_refused(png_begin(8192, 8192, 16, 6, true), "interlaced");
	const struct exr_options floats = {.channels = "BGR", .type = EXR_FLOAT_TYPE};
	assert_refused(exr_begin(100000, 100000, &floats), "100000 x 100000");
	assert_refused(exr_begin(1, 0x7fffffff, &floats), "from 1 x 1");
	assert_refused(exr_begin(0, 1, &floats), "from 1 x 1");
	assert_refused(exr_begin(8192, 8192, &(struct exr_options){.channels = "BGR", .type = 2, .tile = 8192}), "more than 256 MB");
	/* A tile is read whole, however little of it is picture. */
	assert_refused(exr_begin(20, 18, &(struct exr_options){.channels = "BGR", .type = 2, .tile = 8192}), "more than 256 MB");
	assert_refused(exr_begin(20, 18, &(struct exr_options){.channels = "BGR", .type = 2, .tile = 17760272}), "8192 x 8192");
}

static void test_kinds_of_exr(void **state)
{
	(void)state;
	assert_refused(exr_begin(4, 4, &(struct exr_options){.channels = "Y", .type = 2, .flags = 0x800}), "deep");
	assert_refused(exr_begin(4, 4, &(struct exr_options){.channels = "Y", .type = 2, .flags = 0x1000}), "several parts");
	assert_refused(exr_begin(4, 4, &(struct exr_options){.channels = "Y", .type = 2, .flags = 0x8000}), "unknown version");
	assert_refused(exr_begin(4, 4, &(struct exr_options){.channels = "", .type = 2}), "without channels");
	assert_refused(exr_begin(4, 4, &(struct exr_options){.channels = "Y", .type = EXR_UINT}), "whole numbers");
	assert_refused(exr_begin(4, 4, &(struct exr_options){.channels = "Y", .type = 2, .sampling = 2}), "subsampled");
	assert_refused(exr_begin(4, 4, &(struct exr_options){.channels = "ABCDEFGHIJKLMNOPQ", .type = 2}), "more than 16 channels");
	assert_refused(exr_begin(4, 4, &(struct exr_options){.channels = "Y", .type = 2, .compression = 77}), "unknown");
	static const float values[8] = {0};
	assert_refused(exr_of(2, 2, &(struct exr_options){.channels = "XZ", .type = EXR_FLOAT_TYPE}, values), "neither channels R, G, B");
}

static void test_values_that_are_no_numbers(void **state)
{
	(void)state;
	const struct exr_options options = {.channels = "Y", .type = EXR_FLOAT_TYPE};
	const float bad[][2] = {{0, NAN}, {INFINITY, 0}, {0, -INFINITY}};
	for (size_t i = 0; i < 3; i++) {
		struct asset_facts facts;
		char error[256];
		struct file_bytes exr = exr_of(2, 1, &options, bad[i]);
		const int fd = file_of(&exr);
		assert_false(asset_examine(api, fd, exr.size, &facts, error, sizeof error));
		assert_non_null(strstr(error, "not finite"));
		close(fd);
		bytes_finish(&exr);
	}
}

/* libpng tells its troubles to standard error, thousands of them here. */
static int mute(void)
{
	const int kept = dup(STDERR_FILENO), nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
	dup2(nowhere, STDERR_FILENO);
	close(nowhere);
	return kept;
}

static void unmute(int kept)
{
	dup2(kept, STDERR_FILENO);
	close(kept);
}

/* Cut off anywhere, a picture is refused, with a reason. */
static void test_truncated(void **state)
{
	(void)state;
	unsigned char rows[40 * 30];
	float values[20 * 10];
	for (size_t i = 0; i < sizeof rows; i++)
		rows[i] = (unsigned char)(i * 7);
	for (size_t i = 0; i < sizeof values / sizeof *values; i++)
		values[i] = (float)i / 200;
	struct file_bytes whole[] = {png_of(40, 30, 8, 0, rows),
				     exr_of(20, 10, &(struct exr_options){.channels = "Y", .type = EXR_FLOAT_TYPE}, values)};
	const int kept = mute();
	for (int k = 0; k < 2; k++) {
		facts_of(copy_of((char *)whole[k].data, whole[k].size));
		for (size_t size = 0; size < whole[k].size; size += size < 400 ? 1 : 13)
			assert_refused(copy_of((char *)whole[k].data, size), "");
		bytes_finish(&whole[k]);
	}
	unmute(kept);
}

/* Any byte of a file may be any other: some of these are pictures still, none does harm. */
static void test_damaged(void **state)
{
	(void)state;
	unsigned char rows[16 * 16 * 3];
	float values[16 * 16 * 3];
	for (size_t i = 0; i < sizeof rows; i++)
		rows[i] = (unsigned char)(i * 13);
	for (size_t i = 0; i < sizeof values / sizeof *values; i++)
		values[i] = (float)i / 800;
	struct file_bytes whole[] = {png_of(16, 16, 8, 2, rows),
				     exr_of(16, 16, &(struct exr_options){.channels = "BGR", .type = EXR_FLOAT_TYPE}, values)};
	uint64_t bits = 1;
	int taken = 0;
	const int kept = mute();
	for (int i = 0; i < 3000; i++) {
		const struct file_bytes *from = &whole[i % 2];
		struct file_bytes bytes = copy_of((char *)from->data, from->size);
		for (int k = 0; k < 1 + i % 3; k++) {
			bits = bits * 6364136223846793005u + 1442695040888963407u;
			/* Mostly in the headers. */
			bytes.data[(bits >> 33) % (i % 5 ? 400 : bytes.size)] = (unsigned char)(bits >> 20);
		}
		struct asset_facts facts;
		char error[256];
		const int fd = file_of(&bytes);
		taken += asset_examine(api, fd, bytes.size, &facts, error, sizeof error);
		close(fd);
		bytes_finish(&bytes);
	}
	unmute(kept);
	assert_true(taken > 0 && taken < 3000);
	bytes_finish(&whole[0]);
	bytes_finish(&whole[1]);
}

static bool decodes_within(int fd, size_t size, long kilobytes)
{
	char error[256];
	struct rusage before, after;
	getrusage(RUSAGE_SELF, &before);
	struct scene_map *map = asset_decode(api, fd, size, ASSET_THICKNESS, 512, hash, error, sizeof error);
	getrusage(RUSAGE_SELF, &after);
	const bool right = map && map->width == 512 && fabsf(map->values[1234] - 0.4f) < 1e-5f;
	scene_map_release(map);
	return right && after.ru_maxrss - before.ru_maxrss < kilobytes;
}

/* A large picture, 256 MB as floats, is read in strips. */
static void test_memory_follows_from_what_is_kept(void **state)
{
	(void)state;
	enum { LARGE = 8192 };
	unsigned char *rows = calloc(LARGE, LARGE);
	memset(rows, 102, (size_t)LARGE * LARGE);
	struct file_bytes png = png_of(LARGE, LARGE, 8, 0, rows);
	free(rows);
	const int fd = file_of(&png);
	const size_t size = png.size;
	bytes_finish(&png);
	/* A process of its own has a peak of its own. */
	const pid_t child = fork();
	assert_true(child >= 0);
	if (child == 0)
		_exit(decodes_within(fd, size, 32 << 10) ? 0 : 1);
	int status;
	assert_int_equal(waitpid(child, &status, 0), child);
	assert_true(WIFEXITED(status));
	assert_int_equal(WEXITSTATUS(status), 0);
	close(fd);
}

static bool module_path(char path[PATH_MAX])
{
	char self[PATH_MAX];
	const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
	if (length < 0)
		return false;
	self[length] = '\0';
	*strrchr(self, '/') = '\0';
	return snprintf(path, PATH_MAX, "%s/../stratus-image.so", self) < PATH_MAX;
}

int main(void)
{
	char path[PATH_MAX];
	api = module_path(path) ? image_module_load(path) : NULL;
	if (!api)
		return 1;
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_grey),
		cmocka_unit_test(test_depths),
		cmocka_unit_test(test_colours_and_alpha),
		cmocka_unit_test(test_palette),
		cmocka_unit_test(test_exr),
		cmocka_unit_test(test_averaged),
		cmocka_unit_test(test_other_chunks_are_passed_over),
		cmocka_unit_test(test_other_files),
		cmocka_unit_test(test_sizes_that_are_too_large),
		cmocka_unit_test(test_kinds_of_exr),
		cmocka_unit_test(test_values_that_are_no_numbers),
		cmocka_unit_test(test_truncated),
		cmocka_unit_test(test_damaged),
		cmocka_unit_test(test_memory_follows_from_what_is_kept),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
