/* The image module: what it accepts, what it refuses, and that its bytes repeat. With STRATUS_IMAGE_DIR set the samples are also written
 * there, where tests/client/test_image_files.py reads their values back with another reader. */
#include "renderer/image/image.h"

#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { WIDTH = 45, HEIGHT = 70 }; /* no multiples of anything, more rows than one block */

static const struct image_api *api;
static const struct image_metadata metadata = {.scene_json = "{\"note\":\"h\xc3\xa9 \xe2\x98\x81\"}", .software = "stratus test"};

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

/* One value a place, so that any mixed-up row, column, component or layer shows. */
static float sample_value(int layer, int y, int x, int component)
{
	return (float)layer * 100 + (float)y + (float)x / 64 + (float)component * 0.25f;
}

static struct frame sample_frame(enum pixel_type type, int layer_count, const enum layer *layers)
{
	static const size_t bytes_of[] = {1, 2, 4};
	const size_t plane = (size_t)WIDTH * HEIGHT * 3;
	struct frame frame = {.width = WIDTH, .height = HEIGHT, .type = type, .channels = 3, .layer_count = layer_count};
	memcpy(frame.layer, layers, (size_t)layer_count * sizeof *layers);
	frame.exposure_ev = -1.5;
	frame.global_illuminance_lux = 80000;
	frame.bytes = plane * bytes_of[type] * (size_t)layer_count;
	frame.pixels = malloc(frame.bytes);
	assert_non_null(frame.pixels);
	for (size_t i = 0; i < plane * (size_t)layer_count; i++) {
		const size_t place = i % plane;
		const int y = (int)(place / (WIDTH * 3)), x = (int)(place / 3 % WIDTH), component = (int)(place % 3);
		if (type == PIXEL_U8)
			((uint8_t *)frame.pixels)[i] = (uint8_t)(y * 3 + x + component * 7);
		else if (type == PIXEL_U16)
			((uint16_t *)frame.pixels)[i] = (uint16_t)(y * 900 + x * 5 + component * 7);
		else
			((float *)frame.pixels)[i] = sample_value((int)(i / plane), y, x, component);
	}
	return frame;
}

static struct scene sample_scene(enum image_format format)
{
	struct scene scene = scene_default();
	scene.output.format = format;
	scene.output.width = WIDTH;
	scene.output.height = HEIGHT;
	return scene;
}

static struct image_buffer encode(const struct frame *frame, const struct scene *scene)
{
	struct image_buffer buffer;
	char error[256] = "";
	if (!api->encode(frame, scene, &metadata, NULL, &buffer, error, sizeof error))
		fail_msg("%s", error);
	return buffer;
}

static void keep(const char *name, const struct image_buffer *buffer)
{
	const char *folder = getenv("STRATUS_IMAGE_DIR");
	char path[PATH_MAX];
	if (!folder)
		return;
	snprintf(path, sizeof path, "%s/%s", folder, name);
	FILE *file = fopen(path, "wb");
	assert_non_null(file);
	assert_int_equal(fwrite(buffer->data, 1, buffer->size, file), buffer->size);
	fclose(file);
}

/* Encodes twice, compares the bytes, keeps the file. */
static void encode_and_repeat(const char *name, const struct frame *frame, const struct scene *scene)
{
	struct image_buffer first = encode(frame, scene), second = encode(frame, scene);
	assert_int_equal(first.size, second.size);
	assert_memory_equal(first.data, second.data, first.size);
	keep(name, &first);
	free(first.data);
	free(second.data);
}

static void refuses(const struct frame *frame, const struct scene *scene, const char *word)
{
	struct image_buffer buffer = {.data = (unsigned char *)1, .size = 1};
	char error[256] = "";
	assert_false(api->encode(frame, scene, &metadata, NULL, &buffer, error, sizeof error));
	assert_null(buffer.data);
	if (!strstr(error, word))
		fail_msg("\"%s\" does not say \"%s\"", error, word);
}

static const enum layer color[] = {LAYER_COLOR};

static void test_png_repeats(void **state)
{
	(void)state;
	for (int bits = 8; bits <= 16; bits += 8)
		for (int compression = 0; compression < PNG_COMPRESSION_COUNT; compression++) {
			struct frame frame = sample_frame(bits == 8 ? PIXEL_U8 : PIXEL_U16, 1, color);
			struct scene scene = sample_scene(IMAGE_PNG);
			char name[64];
			scene.output.bits = bits;
			scene.output.png_compression = compression;
			snprintf(name, sizeof name, "%d-%s.png", bits, scene_png_compression_names[compression]);
			encode_and_repeat(name, &frame, &scene);
			free(frame.pixels);
		}
}

static void test_exr_repeats(void **state)
{
	(void)state;
	static const enum layer layers[] = {LAYER_COLOR, LAYER_SUN_DIRECT, LAYER_TRANSMITTANCE, LAYER_OPTICAL_THICKNESS, LAYER_DISTANCE};
	for (int compression = 0; compression < EXR_COMPRESSION_COUNT; compression++)
		for (int type = 0; type < EXR_TYPE_COUNT; type++) {
			struct frame frame = sample_frame(PIXEL_F32, 5, layers);
			struct scene scene = sample_scene(IMAGE_EXR);
			char name[64];
			((float *)frame.pixels)[(size_t)WIDTH * HEIGHT * 3 + 1] = 1.6e6f; /* green of the sun's disc: too large for half */
			scene.output.exr_compression = compression;
			scene.output.exr_type = type;
			scene.camera.roll_deg = 30;
			scene.camera.position_m[0] = 100;
			snprintf(name, sizeof name, "%s-%s.exr", scene_exr_type_names[type], scene_exr_compression_names[compression]);
			encode_and_repeat(name, &frame, &scene);
			free(frame.pixels);
		}
}

/* Light of deep twilight: all of it below what half has 11 bits for; with a bright spot beside which that is nothing; and bright, but for
 * one value in a hundred and fifty. */
static void test_exr_dark(void **state)
{
	(void)state;
	static const enum layer layers[] = {LAYER_COLOR, LAYER_SKY, LAYER_AIR};
	struct frame frame = sample_frame(PIXEL_F32, 3, layers);
	const struct scene scene = sample_scene(IMAGE_EXR);
	const size_t plane = (size_t)WIDTH * HEIGHT * 3;
	float *values = frame.pixels;
	for (size_t i = 0; i < 3 * plane; i++)
		values[i] = 1e-5f * (1 + 0.001f * (float)(i % 7919));
	values[plane] = values[plane + 1] = values[plane + 2] = 1;
	for (size_t i = 2 * plane; i < 3 * plane; i++)
		values[i] = (i - 2 * plane) / 3 % 150 == 0 ? 3e-5f : 0.01f;
	encode_and_repeat("dark.exr", &frame, &scene);
	free(frame.pixels);
}

static void test_exr_panoramas(void **state)
{
	(void)state;
	for (int projection = PROJECTION_FISHEYE; projection < PROJECTION_COUNT; projection++) {
		struct frame frame = sample_frame(PIXEL_F32, 1, color);
		struct scene scene = sample_scene(IMAGE_EXR);
		char name[64];
		scene.camera.projection = projection;
		snprintf(name, sizeof name, "%s.exr", scene_projection_names[projection]);
		encode_and_repeat(name, &frame, &scene);
		free(frame.pixels);
	}
	struct frame frame = sample_frame(PIXEL_F32, 1, color);
	struct scene scene = sample_scene(IMAGE_EXR);
	scene.camera.projection = PROJECTION_CUBEMAP;
	scene.camera.face = FACE_POS_Z;
	encode_and_repeat("face.exr", &frame, &scene);
	free(frame.pixels);
}

static void test_png_refusals(void **state)
{
	(void)state;
	static const enum layer two[] = {LAYER_COLOR, LAYER_SKY};
	const struct scene scene = sample_scene(IMAGE_PNG);
	struct frame linear = sample_frame(PIXEL_F32, 1, color), deep = sample_frame(PIXEL_U16, 1, color);
	struct frame layered = sample_frame(PIXEL_U8, 2, two);
	refuses(&linear, &scene, "depth");
	refuses(&deep, &scene, "depth");
	refuses(&layered, &scene, "color alone");
	free(linear.pixels);
	free(deep.pixels);
	free(layered.pixels);
}

static void test_exr_refusals(void **state)
{
	(void)state;
	const struct scene scene = sample_scene(IMAGE_EXR);
	struct frame developed = sample_frame(PIXEL_U8, 1, color), poisoned = sample_frame(PIXEL_F32, 1, color);
	refuses(&developed, &scene, "linear");
	((float *)poisoned.pixels)[7] = NAN;
	refuses(&poisoned, &scene, "channel G");
	((float *)poisoned.pixels)[7] = INFINITY;
	refuses(&poisoned, &scene, "not finite");
	free(developed.pixels);
	free(poisoned.pixels);
}

static void test_size_refusals(void **state)
{
	(void)state;
	const struct scene scene = sample_scene(IMAGE_PNG);
	const struct frame whole = sample_frame(PIXEL_U8, 1, color);
	struct frame frame = whole;
	frame.height++;
	refuses(&frame, &scene, "fewer pixels");
	frame = whole;
	frame.width = 0;
	refuses(&frame, &scene, "no RGB");
	frame = whole;
	frame.layer_count = LAYER_COUNT + 1;
	refuses(&frame, &scene, "no layers");
	frame = whole;
	frame.pixels = NULL;
	refuses(&frame, &scene, "fewer pixels");
	free(whole.pixels);
}

static void *encode_in_thread(void *argument)
{
	struct frame frame = sample_frame(PIXEL_F32, 1, color);
	const struct scene scene = sample_scene(IMAGE_EXR);
	struct image_buffer *buffer = argument;
	for (int i = 0; i < 20; i++) {
		free(buffer->data);
		*buffer = encode(&frame, &scene);
	}
	free(frame.pixels);
	return NULL;
}

static void test_threads_agree(void **state)
{
	(void)state;
	pthread_t threads[4];
	struct image_buffer buffers[4] = {0};
	for (int i = 0; i < 4; i++)
		assert_int_equal(pthread_create(&threads[i], NULL, encode_in_thread, &buffers[i]), 0);
	for (int i = 0; i < 4; i++)
		pthread_join(threads[i], NULL);
	for (int i = 0; i < 4; i++) {
		assert_int_equal(buffers[i].size, buffers[0].size);
		assert_memory_equal(buffers[i].data, buffers[0].data, buffers[0].size);
	}
	for (int i = 0; i < 4; i++)
		free(buffers[i].data);
}

static void test_module_loads_once(void **state)
{
	(void)state;
	assert_ptr_equal(image_module_load("/nonexistent/module.so"), api);
}

static int load(void **state)
{
	(void)state;
	char path[PATH_MAX];
	if (image_module_load("/nonexistent/module.so")) /* a failure is no success, and does not stick */
		return -1;
	if (!module_path(path))
		return -1;
	api = image_module_load(path);
	return api ? 0 : -1;
}

struct rows_asked {
	int left, asked;
};

static bool is_enough(void *context)
{
	struct rows_asked *rows = context;
	rows->asked++;
	return rows->left-- <= 0;
}

/* Whenever it is asked, writing ends with nothing; who goes on to the end gets the same bytes as who is not asked. */
static void test_writing_stops(void **state)
{
	(void)state;
	static float light[3 * 200 * 32];
	static unsigned char codes[sizeof light / sizeof *light];
	for (int form = 0; form < 3; form++) {
		struct scene scene = sample_scene(form == 2 ? IMAGE_EXR : IMAGE_PNG);
		scene.output.png_compression = form == 1 ? PNG_SMALL : PNG_FAST;
		scene.output.width = 32;
		scene.output.height = 200;
		const struct frame frame = {.width = 32,
					    .height = 200,
					    .type = form == 2 ? PIXEL_F32 : PIXEL_U8,
					    .channels = 3,
					    .layer_count = 1,
					    .layer = {LAYER_COLOR},
					    .pixels = form == 2 ? (void *)light : codes,
					    .bytes = form == 2 ? sizeof light : sizeof codes};
		struct image_buffer whole = encode(&frame, &scene), buffer;
		struct rows_asked rows = {.left = 1000};
		const struct image_watch watch = {is_enough, &rows};
		char error[256] = "";
		assert_true(api->encode(&frame, &scene, &metadata, &watch, &buffer, error, sizeof error));
		assert_int_equal(buffer.size, whole.size);
		assert_memory_equal(buffer.data, whole.data, whole.size);
		free(buffer.data);
		free(whole.data);
		const int asked = rows.asked;
		assert_in_range(asked, 4, 8);
		for (int at = 0; at < asked; at++) {
			rows = (struct rows_asked){.left = at};
			assert_false(api->encode(&frame, &scene, &metadata, &watch, &buffer, error, sizeof error));
			assert_null(buffer.data);
			assert_int_equal(rows.asked, at + 1);
		}
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_module_loads_once), cmocka_unit_test(test_png_repeats),   cmocka_unit_test(test_exr_repeats),
		cmocka_unit_test(test_exr_dark),          cmocka_unit_test(test_exr_panoramas), cmocka_unit_test(test_png_refusals),
		cmocka_unit_test(test_exr_refusals),      cmocka_unit_test(test_size_refusals), cmocka_unit_test(test_threads_agree),
		cmocka_unit_test(test_writing_stops),
	};
	return cmocka_run_group_tests(tests, load, NULL);
}
