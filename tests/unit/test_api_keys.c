/* Keys: their form and comparison, the file that names them with every fault it can have, what they may ask for, and reading the file
 * again. */
#include "renderer/log.h"
#include "server/api_keys.h"
#include "server/token_bucket.h"

#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

static char path[] = "/tmp/stratus-keys-XXXXXX";

static void write_keys(const char *text, size_t size)
{
	const int fd = open(path, O_WRONLY | O_TRUNC | O_CLOEXEC);
	assert_true(fd >= 0);
	assert_int_equal(write(fd, text, size), size);
	close(fd);
}

/* The line of a key, behind what is there. */
static void add_line(char *text, const char *name, const char *key, const char *limits)
{
	unsigned char hash[API_KEY_HASH_BYTES];
	assert_true(api_key_hash(key, hash));
	sprintf(text + strlen(text), "%s sha256:", name);
	for (int i = 0; i < API_KEY_HASH_BYTES; i++)
		sprintf(text + strlen(text), "%02x", hash[i]);
	sprintf(text + strlen(text), " %s\n", limits);
}

/* --- a key ------------------------------------------------------------------------------------------------------------------------- */

static void test_form(void **state)
{
	char one[API_KEY_SIZE], two[API_KEY_SIZE], bad[API_KEY_SIZE + 8];
	unsigned char hash[API_KEY_HASH_BYTES];
	(void)state;
	assert_true(api_key_make(one) && api_key_make(two));
	assert_string_not_equal(one, two);
	assert_int_equal(strlen(one), API_KEY_SIZE - 1);
	assert_int_equal(strncmp(one, "stk_", 4), 0);
	assert_true(api_key_hash(one, hash));
	for (int i = 0; i < 5; i++) {
		strcpy(bad, one);
		switch (i) {
		case 0:
			strcat(bad, "A");
			break;
		case 1:
			bad[API_KEY_SIZE - 2] = '\0';
			break;
		case 2:
			bad[0] = 'S';
			break;
		case 3:
			bad[10] = '+';
			break;
		case 4:
			bad[10] = ' ';
			break;
		}
		assert_false(api_key_hash(bad, hash));
	}
	assert_false(api_key_hash("", hash));
	assert_false(api_key_hash("password", hash));
}

/* SHA-256 of the text, as `printf %s KEY | sha256sum` says it. */
static void test_hash(void **state)
{
	static const unsigned char expected[] = {0x13, 0x12, 0xe5, 0x82, 0xa4, 0x61, 0x1c, 0x0e, 0x87, 0xb4, 0x4f,
						 0x1c, 0x34, 0xd4, 0x21, 0xa2, 0x1b, 0x02, 0xa2, 0x88, 0xf1, 0x00,
						 0xa6, 0x7e, 0x83, 0xf8, 0xad, 0x10, 0x72, 0x44, 0xa5, 0x5a};
	unsigned char hash[API_KEY_HASH_BYTES], other[API_KEY_HASH_BYTES];
	(void)state;
	assert_true(api_key_hash("stk_0123456789abcdefghijklmnopqrstuvwxyzABCDEFG", hash));
	assert_memory_equal(hash, expected, sizeof expected);
	assert_true(api_key_hashes_match(hash, expected));
	for (int i = 0; i < API_KEY_HASH_BYTES; i++)
		for (int bit = 0; bit < 8; bit++) {
			memcpy(other, hash, sizeof other);
			other[i] ^= (unsigned char)(1 << bit);
			assert_false(api_key_hashes_match(hash, other));
		}
}

/* Every digit comes up everywhere: 2000 keys lack none of 64 at a place but with a chance of 64 x 43 x (63/64)^2000, some 6e-11. */
static void test_digits_are_random(void **state)
{
	static bool seen[API_KEY_DIGITS][128];
	char key[API_KEY_SIZE];
	(void)state;
	for (int i = 0; i < 2000; i++) {
		assert_true(api_key_make(key));
		for (int k = 0; k < API_KEY_DIGITS; k++)
			seen[k][(int)key[4 + k]] = true;
	}
	for (int k = 0; k < API_KEY_DIGITS; k++) {
		int count = 0;
		for (int c = 0; c < 128; c++)
			count += seen[k][c];
		assert_int_equal(count, 64);
	}
}

/* --- the file ---------------------------------------------------------------------------------------------------------------------- */

#define HASH  "sha256:1312e582a4611c0e87b44f1c34d421a21b02a288f100a67e83f8ad107244a55a"
#define OTHER "sha256:1312E582A4611C0E87B44F1C34D421A21B02A288F100A67E83F8AD107244A55B"

static struct key_file file;

static bool reads(const char *text)
{
	write_keys(text, strlen(text));
	return key_file_read(path, &file);
}

static void test_good_files(void **state)
{
	(void)state;
	assert_true(reads(""));
	assert_int_equal(file.count, 0);
	assert_true(reads("# nobody\n\n   \n\t# yet"));
	assert_int_equal(file.count, 0);
	assert_true(reads("# holders\r\n  alice\t" HASH "  requests_per_minute=600 megapixels_per_minute=0.5\r\nb.o-b_2 " OTHER));
	assert_int_equal(file.count, 2);
	assert_string_equal(file.line[0].name, "alice");
	assert_int_equal(file.line[0].hash[0], 0x13);
	assert_int_equal(file.line[0].hash[31], 0x5a);
	assert_true(file.line[0].requests_per_minute == 600 && file.line[0].megapixels_per_minute == 0.5);
	assert_string_equal(file.line[1].name, "b.o-b_2");
	assert_int_equal(file.line[1].hash[31], 0x5b);
	assert_true(isinf(file.line[1].requests_per_minute) && isinf(file.line[1].megapixels_per_minute));
}

static void test_faults_of_files(void **state)
{
	static const char *const faults[] = {
		"alice\n",
		"alice " HASH "0\n",
		"alice sha256:12\n",
		"alice md5:3c10a234ea429c5ca1b5a90acf950270\n",
		"alice sha256:3g10a234ea429c5ca1b5a90acf950270b451a11f7259a7d25c0f33a4c8cd9a2b\n",
		HASH " alice\n",
		"al/ice " HASH "\n",
		"al\"ice " HASH "\n",
		"\xc3\xa4lice " HASH "\n",
		"anonymous " HASH "\n",
		"abcdefghijklmnopqrstuvwxyz1234567 " HASH "\n",
		"alice " HASH "\nalice " OTHER "\n",
		"alice " HASH "\nbob " HASH "\n",
		"alice " HASH " requests_per_minute=\n",
		"alice " HASH " requests_per_minute=0\n",
		"alice " HASH " requests_per_minute=-1\n",
		"alice " HASH " requests_per_minute=nan\n",
		"alice " HASH " requests_per_minute=inf\n",
		"alice " HASH " requests_per_minute=1e10\n",
		"alice " HASH " requests_per_minute=5 requests_per_minute=6\n",
		"alice " HASH " megapixel_per_minute=5\n",
		"alice " HASH " 5\n",
		"alice " HASH " # comment\n",
	};
	(void)state;
	log_set_level(LOG_ERROR);
	for (size_t i = 0; i < sizeof faults / sizeof *faults; i++)
		if (reads(faults[i]))
			fail_msg("taken: %s", faults[i]);
	write_keys("alice " HASH "\n\0bob " OTHER "\n", sizeof "alice " HASH "\n\0bob " OTHER "\n" - 1);
	assert_false(key_file_read(path, &file));
	assert_false(key_file_read("/nowhere/keys", &file));
	assert_false(key_file_read("/tmp", &file));
	assert_false(key_file_read("/dev/null", &file));
}

static void test_as_many_as_fit(void **state)
{
	char *text = calloc(300, 160), name[16], key[API_KEY_SIZE];
	(void)state;
	for (int i = 0; i < KEYS_MAX; i++) {
		sprintf(name, "key%d", i);
		assert_true(api_key_make(key));
		add_line(text, name, key, "");
	}
	assert_true(reads(text));
	assert_int_equal(file.count, KEYS_MAX);
	assert_true(api_key_make(key));
	add_line(text, "one-more", key, "");
	assert_false(reads(text));
	free(text);
}

static void test_who_may_write_it(void **state)
{
	(void)state;
	assert_true(reads("alice " HASH "\n"));
	for (int writable = 0; writable < 2; writable++) {
		assert_int_equal(chmod(path, writable ? 0620 : 0602), 0);
		assert_false(key_file_read(path, &file));
	}
	assert_int_equal(chmod(path, 0644), 0);
	assert_true(key_file_read(path, &file));
	assert_int_equal(chmod(path, 0600), 0);
}

/* --- so much a minute ------------------------------------------------------------------------------------------------------------- */

static void test_bucket(void **state)
{
	struct token_bucket bucket;
	(void)state;
	token_bucket_init(&bucket, 60, 1000);
	for (int i = 0; i < 60; i++)
		assert_true(token_bucket_take(&bucket, 1, 1000) == 0);
	assert_float_equal(token_bucket_take(&bucket, 1, 1000), 1000, 1e-6);
	assert_float_equal(token_bucket_take(&bucket, 1, 1750), 250, 1e-6); /* asking costs nothing */
	assert_true(token_bucket_take(&bucket, 1, 2001) == 0);
	assert_true(token_bucket_take(&bucket, 1, 2001) > 998);
	/* A clock that seems to go back gives nothing and takes nothing. */
	assert_true(token_bucket_take(&bucket, 1, 0) > 998);
	/* No more than a minute's worth is kept. */
	for (int i = 0; i < 60; i++)
		assert_true(token_bucket_take(&bucket, 1, 1e9) == 0);
	assert_true(token_bucket_take(&bucket, 1, 1e9) > 0);
	token_bucket_give_back(&bucket, 1);
	assert_true(token_bucket_take(&bucket, 1, 1e9) == 0);
	token_bucket_give_back(&bucket, 1000);
	assert_true(bucket.level == 60);
}

/* In the long run it is what it says, however it is asked for. */
static void test_rate(void **state)
{
	struct token_bucket bucket;
	double taken = 0;
	(void)state;
	token_bucket_init(&bucket, 2.5, 0);
	for (double now = 0; now < 100 * 60000.0; now += 137) {
		const double amount = 0.01 + fmod(now, 3);
		if (token_bucket_take(&bucket, amount, now) == 0)
			taken += amount;
	}
	assert_in_range((int)taken, 245, 256); /* 100 minutes' worth, one that was there, and what is owed or left */
}

/* What is larger than a minute's worth comes once in as many minutes as it is worth. */
static void test_more_than_a_minutes_worth(void **state)
{
	struct token_bucket bucket;
	(void)state;
	token_bucket_init(&bucket, 10, 0);
	assert_true(token_bucket_take(&bucket, 25, 0) == 0);
	assert_float_equal(token_bucket_take(&bucket, 25, 0), 150000, 1e-6);
	assert_float_equal(token_bucket_take(&bucket, 1, 0), 96000, 1e-6);
	assert_true(token_bucket_take(&bucket, 25, 149999) > 0);
	assert_true(token_bucket_take(&bucket, 25, 150001) == 0);
}

static void test_bucket_without_a_limit(void **state)
{
	struct token_bucket bucket;
	(void)state;
	token_bucket_init(&bucket, INFINITY, 0);
	for (int i = 0; i < 10; i++)
		assert_true(token_bucket_take(&bucket, 1e30, i) == 0);
	token_bucket_give_back(&bucket, 5);
	token_bucket_change(&bucket, 10, 100);
	assert_true(bucket.level == 10);
	assert_true(token_bucket_take(&bucket, 8, 100) == 0);
	token_bucket_change(&bucket, 5, 100); /* of which 8 are gone */
	assert_float_equal(token_bucket_take(&bucket, 1, 100), 4 / 5.0 * 60000, 1e-6);
	token_bucket_change(&bucket, INFINITY, 200);
	assert_true(token_bucket_take(&bucket, 1e30, 200) == 0);
}

/* --- in force --------------------------------------------------------------------------------------------------------------------- */

struct found {
	char names[256];
	unsigned long requests;
	double pixels;
};

static void note(void *context, const char *name, const struct api_key_counts *counts)
{
	struct found *found = context;
	strcat(strcat(found->names, name), " ");
	found->requests += counts->requests;
	found->pixels += counts->pixels;
}

static void test_in_force(void **state)
{
	char alice[API_KEY_SIZE], bob[API_KEY_SIZE], carol[API_KEY_SIZE], name[KEY_NAME_SIZE], text[1024] = "";
	(void)state;
	assert_true(api_key_make(alice) && api_key_make(bob) && api_key_make(carol));
	add_line(text, "alice", alice, "requests_per_minute=3");
	add_line(text, "bob", bob, "");
	write_keys(text, strlen(text));
	struct api_keys *keys = api_keys_create(path);
	assert_non_null(keys);
	assert_true(api_keys_are_asked_for(keys));
	assert_true(api_keys_find(keys, alice, name));
	assert_string_equal(name, "alice");
	assert_true(api_keys_find(keys, bob, name));
	assert_string_equal(name, "bob");
	assert_false(api_keys_find(keys, carol, name));
	assert_false(api_keys_find(keys, "alice", name));

	for (int i = 0; i < 3; i++)
		assert_true(api_keys_take(keys, "alice", KEY_LIMIT_REQUESTS, 1) == 0);
	assert_true(api_keys_take(keys, "alice", KEY_LIMIT_REQUESTS, 1) > 15000);
	assert_true(api_keys_take(keys, "alice", KEY_LIMIT_MEGAPIXELS, 1e6) == 0);
	assert_true(api_keys_take(keys, "bob", KEY_LIMIT_REQUESTS, 1e6) == 0);
	api_keys_count(keys, "alice", 100);
	api_keys_count(keys, "bob", 0);
	api_keys_count(keys, "", 50);

	/* A file that is wrong changes nothing. */
	write_keys("alice\n", 6);
	assert_false(api_keys_reload(keys));
	assert_true(api_keys_find(keys, bob, name));
	/* One that is right: bob is gone, carol new, and alice has what she had left. */
	text[0] = '\0';
	add_line(text, "alice", alice, "requests_per_minute=4");
	add_line(text, "carol", carol, "");
	write_keys(text, strlen(text));
	assert_true(api_keys_reload(keys));
	assert_false(api_keys_find(keys, bob, name));
	assert_true(api_keys_find(keys, carol, name));
	assert_true(api_keys_take(keys, "alice", KEY_LIMIT_REQUESTS, 1) == 0);
	assert_true(api_keys_take(keys, "alice", KEY_LIMIT_REQUESTS, 1) > 10000);
	assert_true(api_keys_take(keys, "bob", KEY_LIMIT_REQUESTS, 1) == 0); /* whose request came before */
	api_keys_count(keys, "bob", 7);
	struct found found = {0};
	api_keys_visit(keys, note, &found);
	assert_string_equal(found.names, "anonymous alice carol ");
	assert_int_equal(found.requests, 2);
	assert_float_equal(found.pixels, 150, 0);
	api_keys_destroy(keys);
}

static void test_without_keys(void **state)
{
	char key[API_KEY_SIZE], name[KEY_NAME_SIZE];
	(void)state;
	struct api_keys *keys = api_keys_create(NULL);
	assert_false(api_keys_are_asked_for(keys));
	assert_true(api_keys_reload(keys));
	assert_true(api_key_make(key));
	assert_false(api_keys_find(keys, key, name));
	assert_true(api_keys_take(keys, "", KEY_LIMIT_REQUESTS, 1e9) == 0);
	api_keys_destroy(keys);
	assert_null(api_keys_create("/nowhere/keys"));
}

static void *use_keys(void *context)
{
	char name[KEY_NAME_SIZE];
	struct api_keys *keys = context;
	for (int i = 0; i < 3000; i++) {
		api_keys_find(keys, "stk_0123456789abcdefghijklmnopqrstuvwxyzABCDEFG", name);
		api_keys_take(keys, "alice", KEY_LIMIT_REQUESTS, 1);
		api_keys_count(keys, "alice", 1);
	}
	return NULL;
}

/* For ThreadSanitizer, too. */
static void test_reload_under_way(void **state)
{
	pthread_t threads[3];
	(void)state;
	assert_true(reads("alice " HASH " requests_per_minute=5\n"));
	log_set_level(LOG_ERROR);
	struct api_keys *keys = api_keys_create(path);
	for (int i = 0; i < 3; i++)
		assert_int_equal(pthread_create(&threads[i], NULL, use_keys, keys), 0);
	for (int i = 0; i < 200; i++)
		assert_true(api_keys_reload(keys));
	for (int i = 0; i < 3; i++)
		pthread_join(threads[i], NULL);
	struct found found = {0};
	api_keys_visit(keys, note, &found);
	assert_int_equal(found.requests, 9000);
	api_keys_destroy(keys);
}

int main(void)
{
	const int fd = mkstemp(path);
	if (fd < 0)
		return 1;
	close(fd);
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_form),
		cmocka_unit_test(test_hash),
		cmocka_unit_test(test_digits_are_random),
		cmocka_unit_test(test_good_files),
		cmocka_unit_test(test_faults_of_files),
		cmocka_unit_test(test_as_many_as_fit),
		cmocka_unit_test(test_who_may_write_it),
		cmocka_unit_test(test_bucket),
		cmocka_unit_test(test_rate),
		cmocka_unit_test(test_more_than_a_minutes_worth),
		cmocka_unit_test(test_bucket_without_a_limit),
		cmocka_unit_test(test_in_force),
		cmocka_unit_test(test_without_keys),
		cmocka_unit_test(test_reload_under_way),
	};
	const int failed = cmocka_run_group_tests(tests, NULL, NULL);
	unlink(path);
	return failed;
}
