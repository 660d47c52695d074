/* Finished images in memory: found under their tags, least recently used out first, never freed while somebody holds them. */
#include "server/cache_control.h"
#include "server/image_cache.h"

#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* An image whose every byte is told by its tag. */
static struct finished_image *make(unsigned number, size_t size)
{
	char tag[ENTITY_TAG_SIZE];
	unsigned char *data = malloc(size);
	assert_non_null(data);
	memset(data, (int)(number % 251), size);
	snprintf(tag, sizeof tag, "\"%032x\"", number);
	struct finished_image *image = finished_image_create(tag, data, size, 1, 0);
	assert_non_null(image);
	return image;
}

static bool keep(struct image_cache *cache, unsigned number, size_t size)
{
	struct finished_image *image = make(number, size);
	const bool kept = image_cache_keep(cache, image);
	finished_image_release(image);
	return kept;
}

static struct finished_image *find(struct image_cache *cache, unsigned number)
{
	char tag[ENTITY_TAG_SIZE];
	snprintf(tag, sizeof tag, "\"%032x\"", number);
	return image_cache_find(cache, tag);
}

static bool has(struct image_cache *cache, unsigned number)
{
	struct finished_image *image = find(cache, number);
	const bool found = image;
	if (image)
		assert_int_equal(image->data[image->size - 1], number % 251);
	finished_image_release(image);
	return found;
}

static void test_least_recently_used_goes_first(void **state)
{
	(void)state;
	struct image_cache *cache = image_cache_create(4 * 1200);
	assert_non_null(cache);
	for (unsigned i = 0; i < 4; i++)
		assert_true(keep(cache, i, 1000));
	assert_true(has(cache, 0)); /* now 1 is the oldest */
	assert_true(keep(cache, 4, 1000));
	assert_true(has(cache, 0) && !has(cache, 1) && has(cache, 2) && has(cache, 3) && has(cache, 4));
	const struct image_cache_counts counts = image_cache_counts(cache);
	assert_int_equal(counts.images, 4);
	assert_int_equal(counts.evicted, 1);
	assert_in_range(counts.bytes, 4000, counts.bound);
	image_cache_destroy(cache);
}

static void test_one_large_image_drops_many_small_ones(void **state)
{
	(void)state;
	struct image_cache *cache = image_cache_create(100000);
	for (unsigned i = 0; i < 50; i++)
		assert_true(keep(cache, i, 1000));
	assert_true(keep(cache, 50, 99000));
	assert_true(has(cache, 50));
	assert_int_equal(image_cache_counts(cache).images, 1);
	assert_false(keep(cache, 51, 100000)); /* what belongs to it has no room beside it */
	assert_true(has(cache, 50));
	image_cache_destroy(cache);
}

static void test_nothing_is_kept_without_room(void **state)
{
	(void)state;
	struct image_cache *cache = image_cache_create(0);
	assert_false(keep(cache, 1, 1));
	assert_false(has(cache, 1));
	assert_int_equal(image_cache_counts(cache).bytes, 0);
	image_cache_destroy(cache);
	image_cache_destroy(NULL);
}

static void test_the_same_twice(void **state)
{
	(void)state;
	struct image_cache *cache = image_cache_create(10000);
	assert_true(keep(cache, 1, 1000));
	assert_true(keep(cache, 2, 1000));
	const size_t bytes = image_cache_counts(cache).bytes;
	assert_true(keep(cache, 1, 1000));
	assert_int_equal(image_cache_counts(cache).bytes, bytes);
	assert_int_equal(image_cache_counts(cache).images, 2);
	image_cache_destroy(cache);
}

static void test_a_dropped_image_stays_for_who_holds_it(void **state)
{
	(void)state;
	struct image_cache *cache = image_cache_create(2000);
	assert_true(keep(cache, 7, 1500));
	struct finished_image *held = find(cache, 7);
	assert_true(keep(cache, 8, 1500));
	assert_false(has(cache, 7));
	assert_int_equal(held->data[1499], 7);
	image_cache_destroy(cache);
	assert_int_equal(held->data[0], 7);
	finished_image_release(held);
}

enum { THREADS = 4, ROUNDS = 20000, TAGS = 64 };

static void test_all_are_dropped_at_once(void **state)
{
	(void)state;
	struct image_cache *cache = image_cache_create(100000);
	for (unsigned i = 0; i < 9; i++)
		assert_true(keep(cache, i, 1000));
	struct finished_image *held = find(cache, 3);
	image_cache_clear(cache);
	image_cache_clear(cache);
	for (unsigned i = 0; i < 9; i++)
		assert_false(has(cache, i));
	assert_int_equal(held->data[0], 3);
	finished_image_release(held);
	const struct image_cache_counts counts = image_cache_counts(cache);
	assert_int_equal(counts.images, 0);
	assert_int_equal(counts.bytes, 0);
	assert_true(keep(cache, 3, 1000));
	image_cache_destroy(cache);
}

static void *work(void *argument)
{
	struct image_cache *cache = argument;
	unsigned random = (unsigned)(uintptr_t)pthread_self() | 1;
	for (int i = 0; i < ROUNDS; i++) {
		random = random * 1664525 + 1013904223;
		const unsigned number = (random >> 16) % TAGS;
		if (!has(cache, number))
			keep(cache, number, 100 + 10 * number);
	}
	return NULL;
}

static void test_many_threads(void **state)
{
	(void)state;
	struct image_cache *cache = image_cache_create(10000);
	pthread_t threads[THREADS];
	for (int i = 0; i < THREADS; i++)
		assert_int_equal(pthread_create(&threads[i], NULL, work, cache), 0);
	for (int i = 0; i < THREADS; i++)
		pthread_join(threads[i], NULL);
	const struct image_cache_counts counts = image_cache_counts(cache);
	assert_true(counts.bytes <= counts.bound && counts.images > 0 && counts.evicted > 0);
	image_cache_destroy(cache);
}

static void test_directives_of_a_request(void **state)
{
	(void)state;
	static const struct {
		const char *header;
		bool no_cache, no_store;
	} cases[] = {
		{NULL, false, false},
		{"", false, false},
		{"no-cache", true, false},
		{"No-Store", false, true},
		{"max-age=0, no-cache", true, false},
		{" no-store ,no-cache", true, true},
		{"no-cache=\"set-cookie\"", true, false},
		{"x=\"no-cache, no-store\", max-age=3", false, false},
		{"x=\"a\\\", no-store\"", false, false},
		{"no-cachexyz, xno-store", false, false},
		{",,no-store", false, true},
		{"x=\"", false, false},
	};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		assert_int_equal(cache_control_names(cases[i].header, "no-cache"), cases[i].no_cache);
		assert_int_equal(cache_control_names(cases[i].header, "no-store"), cases[i].no_store);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_least_recently_used_goes_first),
		cmocka_unit_test(test_one_large_image_drops_many_small_ones),
		cmocka_unit_test(test_nothing_is_kept_without_room),
		cmocka_unit_test(test_the_same_twice),
		cmocka_unit_test(test_a_dropped_image_stays_for_who_holds_it),
		cmocka_unit_test(test_all_are_dropped_at_once),
		cmocka_unit_test(test_many_threads),
		cmocka_unit_test(test_directives_of_a_request),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
