/* The cache: what is found, what is dropped first, what a frame in work holds on to. */
#include "renderer/cache.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

static int destroyed[16];

static void destroy(void *value)
{
	++*(int *)value;
}

static struct cache_key key_of(double number)
{
	struct cache_key key = cache_key_make("test");
	cache_key_add(&key, number);
	return key;
}

static void keep(struct cache *cache, int number, size_t bytes)
{
	const struct cache_key key = key_of(number);
	destroyed[number] = 0;
	assert_true(cache_keep(cache, &key, &destroyed[number], bytes, destroy));
}

static void *find(struct cache *cache, int number)
{
	const struct cache_key key = key_of(number);
	return cache_find(cache, &key);
}

static void keys_tell_apart(void **state)
{
	(void)state;
	struct cache *cache = cache_create(1000);
	cache_begin_frame(cache);
	keep(cache, 1, 10);
	assert_ptr_equal(find(cache, 1), &destroyed[1]);
	assert_null(find(cache, 2));
	const struct cache_key other = cache_key_make("tess"), shorter = cache_key_make("test");
	assert_null(cache_find(cache, &other));
	assert_null(cache_find(cache, &shorter));
	/* Minus zero is zero. */
	keep(cache, 0, 10);
	const struct cache_key minus = key_of(-0.0);
	assert_ptr_equal(cache_find(cache, &minus), &destroyed[0]);
	assert_int_equal(cache_bytes(cache), 20);
	cache_destroy(cache);
	assert_int_equal(destroyed[0], 1);
	assert_int_equal(destroyed[1], 1);
	cache_destroy(NULL);
}

static void bytes_are_counted_for_their_owner(void **state)
{
	(void)state;
	struct cache *cache = cache_create(100);
	cache_begin_frame(cache);
	keep(cache, 1, 30);
	cache_set_owner(cache, 3);
	keep(cache, 2, 40);
	keep(cache, 3, 5);
	assert_int_equal(cache_owned_bytes(cache, 0), 30);
	assert_int_equal(cache_owned_bytes(cache, 3), 45);
	/* What is dropped is taken from its own owner, whoever keeps at the moment. */
	cache_begin_frame(cache);
	keep(cache, 4, 49);
	assert_int_equal(destroyed[1], 1);
	assert_int_equal(cache_owned_bytes(cache, 0), 0);
	assert_int_equal(cache_owned_bytes(cache, 3), 94);
	assert_int_equal(cache_bytes(cache), 94);
	cache_destroy(cache);
}

static void an_owner_may_have_a_bound_of_its_own(void **state)
{
	(void)state;
	struct cache *cache = cache_create(1000);
	cache_bound_owner(cache, 3, 250);
	cache_begin_frame(cache);
	keep(cache, 1, 100);
	cache_set_owner(cache, 3);
	for (int i = 2; i < 6; i++) {
		cache_begin_frame(cache);
		keep(cache, i, 100);
	}
	/* Only its own went, the oldest of them. */
	assert_int_equal(cache_owned_bytes(cache, 3), 200);
	assert_int_equal(destroyed[1] + 10 * destroyed[2] + 100 * destroyed[3] + 1000 * destroyed[4] + 10000 * destroyed[5], 110);
	/* A frame holds what is above the bound until the next one begins. */
	keep(cache, 6, 100);
	keep(cache, 7, 100);
	assert_int_equal(cache_owned_bytes(cache, 3), 300);
	cache_begin_frame(cache);
	assert_int_equal(cache_owned_bytes(cache, 3), 200);
	cache_destroy(cache);
}

static void least_recently_used_goes_first(void **state)
{
	(void)state;
	struct cache *cache = cache_create(100);
	for (int i = 0; i < 3; i++) {
		cache_begin_frame(cache);
		keep(cache, i, 30);
	}
	cache_begin_frame(cache);
	assert_non_null(find(cache, 0)); /* used again, so 1 is the oldest */
	cache_begin_frame(cache);
	keep(cache, 3, 30);
	assert_int_equal(destroyed[1], 1);
	assert_int_equal(destroyed[0] + destroyed[2] + destroyed[3], 0);
	assert_null(find(cache, 1));
	assert_non_null(find(cache, 0));
	assert_int_equal(cache_bytes(cache), 90);
	cache_destroy(cache);
}

static void a_frame_holds_what_it_uses(void **state)
{
	(void)state;
	struct cache *cache = cache_create(50);
	cache_begin_frame(cache);
	keep(cache, 0, 40);
	cache_begin_frame(cache);
	assert_non_null(find(cache, 0)); /* found in this frame, so kept through it */
	keep(cache, 1, 40);
	keep(cache, 2, 500);
	assert_int_equal(destroyed[0] + destroyed[1] + destroyed[2], 0);
	assert_int_equal(cache_bytes(cache), 580);
	/* The next frame frees what is beyond the bound. */
	cache_begin_frame(cache);
	assert_true(cache_bytes(cache) <= 50);
	cache_destroy(cache);
	for (int i = 0; i < 3; i++)
		assert_int_equal(destroyed[i], 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(keys_tell_apart),
		cmocka_unit_test(bytes_are_counted_for_their_owner),
		cmocka_unit_test(an_owner_may_have_a_bound_of_its_own),
		cmocka_unit_test(least_recently_used_goes_first),
		cmocka_unit_test(a_frame_holds_what_it_uses),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
