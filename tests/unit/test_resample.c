/* Pictures of other sizes: means when smaller, monotone curves when larger, periodic edges; and maps as textures want them. */
#include "renderer/resample.h"
#include "renderer/scene_map.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static uint64_t bits = 1;

static float random_unit(void)
{
	bits = bits * 6364136223846793005u + 1442695040888963407u;
	return (float)(bits >> 40) / 16777216.0f;
}

static float *random_picture(int count)
{
	float *picture = malloc((size_t)count * sizeof *picture);
	for (int i = 0; i < count; i++)
		picture[i] = random_unit();
	return picture;
}

static double mean_of(const float *values, int count)
{
	double sum = 0;
	for (int i = 0; i < count; i++)
		sum += values[i];
	return sum / count;
}

/* The mean of a picture over a rectangle, by its very definition. */
static double area_mean(const float *from, int width, int height, double left, double top, double right, double bottom)
{
	double sum = 0;
	for (int y = 0; y < height; y++)
		for (int x = 0; x < width; x++) {
			const double w = fmin(x + 1, right) - fmax(x, left), h = fmin(y + 1, bottom) - fmax(y, top);
			if (w > 0 && h > 0)
				sum += w * h * from[y * width + x];
		}
	return sum / ((right - left) * (bottom - top));
}

static void test_smaller_is_the_mean_over_area(void **state)
{
	(void)state;
	enum { W = 37, H = 23, TO_W = 8, TO_H = 23 };
	static const int heights[] = {23, 11, 7, 1};
	float *from = random_picture(W * H);
	for (size_t k = 0; k < sizeof heights / sizeof *heights; k++) {
		const int to_h = heights[k];
		float *to = resample_periodic(from, W, H, 1, TO_W, to_h);
		for (int y = 0; y < to_h; y++)
			for (int x = 0; x < TO_W; x++)
				assert_float_equal(to[y * TO_W + x],
						   area_mean(from, W, H, (double)x * W / TO_W, (double)y * H / to_h, (x + 1.0) * W / TO_W,
							     (y + 1.0) * H / to_h),
						   1e-5);
		assert_float_equal(mean_of(to, TO_W * to_h), mean_of(from, W * H), 1e-5);
		free(to);
	}
	free(from);
}

static void test_rows_one_by_one_give_the_same(void **state)
{
	(void)state;
	enum { W = 50, H = 41, C = 3 };
	float *from = random_picture(W * H * C), streamed[17 * 13 * C];
	float *whole = resample_periodic(from, W, H, C, 17, 13);
	struct resample_reducer reducer;
	assert_true(resample_reducer_init(&reducer, W, H, C, 17, 13, streamed));
	for (int y = 0; y < H; y++)
		resample_reducer_add(&reducer, from + y * W * C);
	resample_reducer_finish(&reducer);
	for (int i = 0; i < 17 * 13 * C; i++)
		assert_float_equal(streamed[i], whole[i], 1e-5);
	free(whole);
	free(from);
}

static void test_the_same_size_changes_nothing(void **state)
{
	(void)state;
	float *from = random_picture(24), *to = resample_periodic(from, 4, 3, 2, 4, 3);
	assert_memory_equal(from, to, 24 * sizeof *from);
	free(to);
	free(from);
}

/* Between the four texels around it a larger picture stays within their range, which bicubic curves usually do not. */
static void test_larger_never_overshoots(void **state)
{
	(void)state;
	enum { N = 9, BIG = 128 };
	float *from = random_picture(N * N);
	from[40] = 1, from[41] = 0, from[31] = 0; /* edges as steep as can be */
	float *to = resample_periodic(from, N, N, 1, BIG, BIG);
	for (int y = 0; y < BIG; y++)
		for (int x = 0; x < BIG; x++) {
			const int x0 = (int)floor((x + 0.5) * N / BIG - 0.5), y0 = (int)floor((y + 0.5) * N / BIG - 0.5);
			float low = 2, high = -1;
			for (int i = 0; i < 4; i++) {
				const float corner = from[(y0 + i / 2 + N) % N * N + (x0 + i % 2 + N) % N];
				low = fminf(low, corner);
				high = fmaxf(high, corner);
			}
			assert_true(to[y * BIG + x] >= low - 1e-6f && to[y * BIG + x] <= high + 1e-6f);
		}
	free(to);
	free(from);
}

/* Odd factors put a new texel's centre on each old one's: there it has its value. */
static void test_larger_meets_the_texels(void **state)
{
	(void)state;
	enum { N = 6, F = 5 };
	float *from = random_picture(N * N), *to = resample_periodic(from, N, N, 1, N * F, N * F);
	for (int y = 0; y < N; y++)
		for (int x = 0; x < N; x++)
			assert_float_equal(to[(y * F + F / 2) * N * F + x * F + F / 2], from[y * N + x], 1e-6);
	free(to);
	free(from);
}

/* Moving a picture along by texels moves what is made of it, over the edges too. */
static void test_edges_are_periodic(void **state)
{
	(void)state;
	enum { N = 5, F = 4 };
	float *from = random_picture(N * N), moved[N * N];
	for (int y = 0; y < N; y++)
		for (int x = 0; x < N; x++)
			moved[(y + 2) % N * N + (x + 1) % N] = from[y * N + x];
	float *a = resample_periodic(from, N, N, 1, N * F, N * F), *b = resample_periodic(moved, N, N, 1, N * F, N * F);
	for (int y = 0; y < N * F; y++)
		for (int x = 0; x < N * F; x++)
			assert_float_equal(b[(y + 2 * F) % (N * F) * N * F + (x + F) % (N * F)], a[y * N * F + x], 1e-6);
	free(a);
	free(b);
	free(from);
}

/* A smooth wave comes out as the wave: the error of monotone cubics falls with the square of the step at extremes. */
static void test_larger_is_smooth(void **state)
{
	(void)state;
	enum { N = 32, BIG = 256 };
	float from[N];
	for (int x = 0; x < N; x++)
		from[x] = (float)sin(2 * M_PI * (x + 0.5) / N);
	float *to = resample_periodic(from, N, 1, 1, BIG, 1);
	for (int x = 0; x < BIG; x++)
		assert_float_equal(to[x], sin(2 * M_PI * (x + 0.5) / BIG), 0.01);
	free(to);
}

static void test_textures_begin_in_the_south(void **state)
{
	(void)state;
	static const unsigned char hash[SCENE_MAP_HASH_BYTES] = {1, 2, 3};
	struct scene_map *map = scene_map_create(2, 2, 1, hash);
	static const float values[] = {0.9f, 0.1f, 0.2f, 0.0f}; /* north-west, north-east, south-west, south-east */
	memcpy(map->values, values, sizeof values);
	scene_map_seal(map);
	float *texels = scene_map_texels(map, 2);
	static const float turned[] = {0.2f, 0.0f, 0.9f, 0.1f};
	assert_memory_equal(texels, turned, sizeof turned);
	free(texels);

	double share = 0, mean = 0;
	for (int i = 0; i < SCENE_MAP_BINS; i++) {
		share += map->bins[i].share;
		mean += map->bins[i].share * map->bins[i].value;
	}
	assert_float_equal(share, 1, 1e-9);
	assert_float_equal(mean, 0.3, 1e-6);
	assert_ptr_equal(scene_map_hold(map), map);
	scene_map_release(map);
	assert_int_equal(map->width, 2); /* still held */
	scene_map_release(map);
	scene_map_release(NULL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_smaller_is_the_mean_over_area),
		cmocka_unit_test(test_rows_one_by_one_give_the_same),
		cmocka_unit_test(test_the_same_size_changes_nothing),
		cmocka_unit_test(test_larger_never_overshoots),
		cmocka_unit_test(test_larger_meets_the_texels),
		cmocka_unit_test(test_edges_are_periodic),
		cmocka_unit_test(test_larger_is_smooth),
		cmocka_unit_test(test_textures_begin_in_the_south),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
