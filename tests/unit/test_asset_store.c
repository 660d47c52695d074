/* Uploaded pictures on disk: names, whole files or none, limits, conditions, and what open files and other processes see. */
#include "server/asset_maps.h"
#include "server/asset_store.h"

#include "renderer/file_replace.h"
#include "renderer/log.h"

#include <dirent.h>
#include <errno.h>
#include <ftw.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

static char state[64];
static struct asset_store *store;
static const struct asset_limits limits = {.file_bytes = 1000, .total_bytes = 2500, .count = 3};
static const struct asset_facts facts = {
	.format = IMAGE_EXR, .width = 3, .height = 2, .lowest = {0.1f, 0.2f}, .highest = {0.8f, 0.9f}, .mean_albedo = {0.3f, 0.4f, 0.5f}};
static const struct asset_condition always = {0};

static int open_store(void **unused)
{
	(void)unused;
	strcpy(state, "/tmp/stratus-assets-XXXXXX");
	store = mkdtemp(state) ? asset_store_create(state, &limits) : NULL;
	return store ? 0 : -1;
}

static int remove_one(const char *path, const struct stat *status, int type, struct FTW *at)
{
	(void)status, (void)type, (void)at;
	return remove(path);
}

static int close_store(void **unused)
{
	(void)unused;
	asset_store_destroy(store);
	return nftw(state, remove_one, 16, FTW_DEPTH | FTW_PHYS);
}

/* Uploads so many bytes of a letter. */
static enum asset_result upload_if(const char *name, char letter, size_t size, const struct asset_condition *condition, bool *created)
{
	char bytes[2000], hash[DIGEST_SIZE];
	struct asset_upload *upload;
	memset(bytes, letter, sizeof bytes);
	enum asset_result result = asset_upload_begin(store, name, 0, "me", &upload);
	for (size_t at = 0; result == ASSET_OK && at < size; at += 300)
		result = asset_upload_append(upload, bytes, size - at < 300 ? size - at : 300);
	if (result == ASSET_OK)
		result = asset_upload_commit(upload, &facts, condition, created, hash);
	asset_upload_destroy(upload);
	return result;
}

static enum asset_result upload(const char *name, char letter, size_t size)
{
	bool created;
	return upload_if(name, letter, size, &always, &created);
}

/* Its only letter; NUL when there is no such asset, or it is no such thing. */
static char letter_of(const struct asset_file *file)
{
	char bytes[2000];
	const ssize_t size = file->fd < 0 ? -1 : pread(file->fd, bytes, file->bytes, 0);
	for (ssize_t i = 0; i < size; i++)
		if (bytes[i] != bytes[0])
			return '\0';
	return size == (ssize_t)file->bytes ? bytes[0] : '\0';
}

static char stored_letter(const char *name)
{
	struct asset_file file;
	const char letter = asset_store_open(store, name, &file) == ASSET_OK ? letter_of(&file) : '\0';
	asset_file_close(&file);
	return letter;
}

static int count_files(const char *folder)
{
	char path[128];
	int count = 0;
	snprintf(path, sizeof path, "%s/assets/%s", state, folder);
	DIR *stream = opendir(path);
	for (struct dirent *entry; stream && (entry = readdir(stream));)
		count += entry->d_name[0] != '.';
	if (stream)
		closedir(stream);
	return count;
}

static void test_names(void **unused)
{
	(void)unused;
	char longest[65];
	memset(longest, 'a', 64);
	longest[64] = '\0';
	assert_false(asset_name_is_valid(longest));
	assert_true(asset_name_is_valid(longest + 1));
	static const char *const good[] = {"a", "A-b_c.9", "-", "_", "x..y", "upload.abcdef"};
	static const char *const bad[] = {"", ".", "..", ".a", "a/b", "/a", "../a", "a\\b", "a b", "a\n", "a%", "\xc3\xa4", "a:b", "~"};
	for (size_t i = 0; i < sizeof good / sizeof *good; i++)
		assert_true(asset_name_is_valid(good[i]));
	for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
		struct asset_file file;
		assert_false(asset_name_is_valid(bad[i]));
		assert_int_equal(asset_store_open(store, bad[i], &file), ASSET_MISSING);
		assert_int_equal(asset_store_delete(store, bad[i], &always), ASSET_MISSING);
	}
}

static void test_what_is_kept(void **unused)
{
	(void)unused;
	struct asset_file file;
	bool created = false;
	assert_int_equal(asset_store_open(store, "map", &file), ASSET_MISSING);
	assert_int_equal(upload_if("map", 'x', 700, &always, &created), ASSET_OK);
	assert_true(created);
	assert_int_equal(asset_store_open(store, "map", &file), ASSET_OK);
	assert_int_equal(file.bytes, 700);
	assert_int_equal(letter_of(&file), 'x');
	assert_memory_equal(&file.facts, &facts, sizeof facts);
	char digest[DIGEST_SIZE], bytes[700];
	memset(bytes, 'x', sizeof bytes);
	digest_of(bytes, sizeof bytes, digest);
	assert_string_equal(file.hash, digest);

	/* Replaced, then deleted: who has it open sees what it was. */
	assert_int_equal(upload_if("map", 'y', 10, &always, &created), ASSET_OK);
	assert_false(created);
	assert_int_equal(letter_of(&file), 'x');
	assert_int_equal(stored_letter("map"), 'y');
	assert_int_equal(asset_store_delete(store, "map", &always), ASSET_OK);
	assert_int_equal(letter_of(&file), 'x');
	assert_int_equal(stored_letter("map"), '\0');
	assert_int_equal(asset_store_delete(store, "map", &always), ASSET_MISSING);
	asset_file_close(&file);
	assert_int_equal(count_files("incoming"), 0);
	assert_int_equal(count_files("files"), 0);
}

static void test_limits(void **unused)
{
	(void)unused;
	struct asset_upload *other;
	assert_int_equal(upload("large", 'a', 1001), ASSET_TOO_LARGE);
	assert_int_equal(asset_upload_begin(store, "large", 1001, "me", &other), ASSET_TOO_LARGE);
	assert_int_equal(upload("a", 'a', 1000), ASSET_OK);
	assert_int_equal(upload("b", 'b', 1000), ASSET_OK);
	assert_int_equal(upload("c", 'c', 501), ASSET_FULL);
	assert_int_equal(asset_upload_begin(store, "c", 501, "me", &other), ASSET_FULL);
	assert_int_equal(upload("b", 'B', 1000), ASSET_OK); /* in place of its own */
	assert_int_equal(upload("c", 'c', 100), ASSET_OK);
	assert_int_equal(upload("d", 'd', 1), ASSET_FULL); /* three are enough */
	assert_int_equal(upload("c", 'C', 400), ASSET_OK);
	assert_int_equal(asset_store_delete(store, "a", &always), ASSET_OK);
	assert_int_equal(upload("d", 'd', 1), ASSET_OK);
	size_t count;
	uint64_t bytes;
	asset_store_usage(store, &count, &bytes);
	assert_int_equal(count, 3);
	assert_int_equal(bytes, 1401);
	assert_int_equal(count_files("incoming"), 0);
}

/* What comes in counts as well, else many at once would fill the disk. */
static void test_uploads_count_while_they_come_in(void **unused)
{
	(void)unused;
	static const char bytes[1000];
	struct asset_upload *first[3], *more[32];
	for (int i = 0; i < 3; i++)
		assert_int_equal(asset_upload_begin(store, "a", 0, "me", &first[i]), ASSET_OK);
	assert_int_equal(asset_upload_append(first[0], bytes, 1000), ASSET_OK);
	assert_int_equal(asset_upload_append(first[1], bytes, 1000), ASSET_OK);
	assert_int_equal(asset_upload_append(first[2], bytes, 501), ASSET_FULL);
	asset_upload_destroy(first[2]);
	asset_upload_destroy(first[0]);
	int admitted = 0;
	char client[32] = "me";
	/* As many clients as it takes: each has a part only. */
	for (int i = 0; admitted < ASSET_UPLOADS_MAX - 1; i++) {
		snprintf(client, sizeof client, "client %d", i);
		admitted += asset_upload_begin(store, "b", 1, client, &more[admitted]) == ASSET_OK;
	}
	assert_int_equal(asset_upload_begin(store, "b", 1, "new", &first[0]), ASSET_BUSY); /* one is left of the first */
	while (admitted > 0)
		asset_upload_destroy(more[--admitted]);
	asset_upload_destroy(first[1]);
	/* What has its name counts once, whoever still has hold of the upload. */
	char hash[DIGEST_SIZE];
	bool created;
	assert_int_equal(asset_upload_begin(store, "a", 1000, "me", &first[0]), ASSET_OK);
	assert_int_equal(asset_upload_append(first[0], bytes, 1000), ASSET_OK);
	assert_int_equal(asset_upload_commit(first[0], &facts, &always, &created, hash), ASSET_OK);
	assert_int_equal(upload("b", 'b', 1000), ASSET_OK);
	asset_upload_destroy(first[0]);
	assert_int_equal(upload("c", 'c', 501), ASSET_FULL);
	assert_int_equal(upload("c", 'c', 500), ASSET_OK);
	assert_int_equal(count_files("incoming"), 0);
}

/* One that begins upload after upload and ends none leaves half of the places to others, and gives back what it ends. */
static void test_uploads_are_shared(void **unused)
{
	(void)unused;
	struct asset_upload *of_one[ASSET_UPLOADS_MAX], *refused, *of_others[2];
	int count = 0;
	while (count < ASSET_UPLOADS_MAX && asset_upload_begin(store, "a", 1, "one", &of_one[count]) == ASSET_OK)
		count++;
	assert_int_equal(count, ASSET_UPLOADS_MAX / 2);
	assert_int_equal(asset_upload_begin(store, "a", 1, "another", &of_others[0]), ASSET_OK);
	assert_int_equal(asset_upload_begin(store, "b", 1, "a third", &of_others[1]), ASSET_OK);
	asset_upload_destroy(of_one[--count]);
	assert_int_equal(asset_upload_begin(store, "a", 1, "one", &refused), ASSET_BUSY); /* 7 of its own, 7 free: one fewer than before */
	asset_upload_destroy(of_others[0]);
	asset_upload_destroy(of_others[1]);
	assert_int_equal(asset_upload_begin(store, "a", 1, "one", &of_one[count++]), ASSET_OK);
	while (count > 0)
		asset_upload_destroy(of_one[--count]);
	assert_int_equal(count_files("incoming"), 0);
}

static void test_conditions(void **unused)
{
	(void)unused;
	char tag[DIGEST_SIZE + 4];
	struct asset_file file;
	bool created;
	const struct asset_condition if_new = {.if_none_match = "*"}, if_there = {.if_match = "*"}, if_this = {.if_match = tag},
				     if_other = {.if_match = "\"0123\", W/\"0123\""}, not_this = {.if_none_match = tag};
	assert_int_equal(upload_if("a", 'a', 1, &if_there, &created), ASSET_UNWANTED);
	assert_int_equal(upload_if("a", 'a', 1, &if_new, &created), ASSET_OK);
	assert_int_equal(upload_if("a", 'b', 1, &if_new, &created), ASSET_UNWANTED);
	assert_int_equal(upload_if("a", 'b', 1, &if_other, &created), ASSET_UNWANTED);
	assert_int_equal(stored_letter("a"), 'a');
	asset_store_open(store, "a", &file);
	asset_file_close(&file);
	snprintf(tag, sizeof tag, "\"%s\"", file.hash);
	assert_int_equal(upload_if("a", 'b', 1, &not_this, &created), ASSET_UNWANTED);
	assert_int_equal(asset_store_delete(store, "a", &if_other), ASSET_UNWANTED);
	snprintf(tag, sizeof tag, "W/\"%s\"", file.hash); /* weak tags are no match for If-Match */
	assert_int_equal(asset_store_delete(store, "a", &if_this), ASSET_UNWANTED);
	snprintf(tag, sizeof tag, "\"%s\"", file.hash);
	assert_int_equal(upload_if("a", 'b', 1, &if_this, &created), ASSET_OK);
	assert_int_equal(upload_if("a", 'c', 1, &if_this, &created), ASSET_UNWANTED);
	assert_int_equal(stored_letter("a"), 'b');
	assert_int_equal(asset_store_delete(store, "a", &if_there), ASSET_OK);
}

static void add_name(void *context, const char *name, const struct asset_file *file)
{
	char *list = context;
	snprintf(list + strlen(list), 100, "%s %d,", name, (int)file->bytes);
}

static void test_list(void **unused)
{
	(void)unused;
	char list[100] = "", path[128];
	assert_true(asset_store_list(store, add_name, list));
	assert_string_equal(list, "");
	upload("b", 'b', 2);
	upload("a.png", 'a', 1);
	/* Not ours: too short, cut off, of another kind, a link, hidden. */
	snprintf(path, sizeof path, "%s/assets/files/foreign", state);
	fclose(fopen(path, "w"));
	snprintf(path, sizeof path, "%s/assets/files/link", state);
	assert_int_equal(symlink("b", path), 0);
	snprintf(path, sizeof path, "%s/assets/files/.hidden", state);
	fclose(fopen(path, "w"));
	snprintf(path, sizeof path, "%s/assets/files/folder", state);
	assert_int_equal(mkdir(path, 0700), 0);
	log_set_level(LOG_ERROR);
	assert_true(asset_store_list(store, add_name, list));
	assert_string_equal(list, "a.png 1,b 2,");
	snprintf(path, sizeof path, "%s/assets/files/b", state);
	assert_int_equal(truncate(path, 60), 0);
	assert_int_equal(stored_letter("b"), '\0');
	assert_int_equal(upload("foreign", 'f', 1), ASSET_OK); /* names are taken back from what is no asset */
	assert_int_equal(stored_letter("foreign"), 'f');
}

/* A process that is killed at any moment of replacing a file, again and again, leaves one of its files whole; what else it leaves is swept
 * by the next. */
static void test_killed(void **unused)
{
	(void)unused;
	assert_int_equal(upload("a", 'a', 900), ASSET_OK);
	int left = 0;
	for (int i = 0; i < 60 || (left == 0 && i < 2000); i++) { /* until some did die in the middle */
		const pid_t child = fork();
		assert_true(child >= 0);
		if (child == 0)
			for (char letter = 'b';; letter = letter == 'y' ? 'b' : (char)(letter + 1))
				upload("a", letter, 900);
		usleep((unsigned)(1000 + 311 * (i % 60)));
		kill(child, SIGKILL);
		waitpid(child, NULL, 0);
		assert_in_range(stored_letter("a"), 'a', 'y');
		left += count_files("incoming");
		struct asset_store *next = asset_store_create(state, &limits);
		asset_store_destroy(next);
		assert_int_equal(count_files("incoming"), 0);
		assert_int_equal(count_files("files"), 1);
	}
	assert_true(left > 0);
}

/* The sweep of a process that starts spares what another is writing. */
static void test_sweep_spares_the_living(void **unused)
{
	(void)unused;
	struct asset_upload *running;
	char hash[DIGEST_SIZE];
	bool created;
	assert_int_equal(asset_upload_begin(store, "a", 0, "me", &running), ASSET_OK);
	assert_int_equal(asset_upload_append(running, "zzz", 3), ASSET_OK);
	asset_store_destroy(asset_store_create(state, &limits));
	assert_int_equal(asset_upload_commit(running, &facts, &always, &created, hash), ASSET_OK);
	asset_upload_destroy(running);
	assert_int_equal(stored_letter("a"), 'z');
}

static void *replace_and_delete(void *argument)
{
	const char first = *(const char *)argument;
	for (int i = 0; i < 150; i++) {
		const enum asset_result result =
			i % 5 == 4 ? asset_store_delete(store, "a", &always) : upload("a", (char)(first + i % 4), 700);
		assert_true(result == ASSET_OK || result == ASSET_MISSING);
	}
	return NULL;
}

static void test_many_at_once(void **unused)
{
	(void)unused;
	pthread_t threads[3];
	static const char first[] = "aeq";
	for (int i = 0; i < 3; i++)
		assert_int_equal(pthread_create(&threads[i], NULL, replace_and_delete, (void *)&first[i]), 0);
	for (int i = 0; i < 3000; i++) {
		struct asset_file file;
		if (asset_store_open(store, "a", &file) == ASSET_OK)
			assert_int_not_equal(letter_of(&file), '\0');
		asset_file_close(&file);
	}
	for (int i = 0; i < 3; i++)
		pthread_join(threads[i], NULL);
	assert_int_equal(count_files("incoming"), 0);
}

/* --- decoded maps in memory --------------------------------------------------------------------------------------------------------- */

static struct asset_file file_of(char letter, int side)
{
	struct asset_file file = {.fd = -1, .facts = {.width = side, .height = side}};
	memset(file.hash, letter, DIGEST_SIZE - 1);
	return file;
}

static void keep(struct asset_maps *maps, const struct asset_file *file, enum asset_use use, int side)
{
	unsigned char hash[SCENE_MAP_HASH_BYTES];
	asset_hash_bytes(file, hash);
	struct scene_map *map = scene_map_create(side, side, use == ASSET_THICKNESS ? 1 : 3, hash);
	assert_true(asset_maps_make_room(maps, file, use, side, NULL));
	asset_maps_keep(maps, file, use, side, map);
	scene_map_release(map);
}

static bool has(struct asset_maps *maps, const struct asset_file *file, enum asset_use use, int side)
{
	const struct scene_map *map = asset_maps_find(maps, file, use, side);
	scene_map_release(map);
	return map;
}

static void test_maps_by_content_use_and_size(void **unused)
{
	(void)unused;
	struct asset_maps *maps = asset_maps_create(1 << 20);
	const struct asset_file a = file_of('a', 32), b = file_of('b', 128);
	keep(maps, &a, ASSET_THICKNESS, 32);
	keep(maps, &b, ASSET_THICKNESS, 64);
	assert_true(has(maps, &a, ASSET_THICKNESS, 32));
	assert_true(has(maps, &a, ASSET_THICKNESS, 512)); /* smaller than either */
	assert_false(has(maps, &a, ASSET_THICKNESS, 16));
	assert_false(has(maps, &a, ASSET_ALBEDO, 32));
	assert_true(has(maps, &b, ASSET_THICKNESS, 64));
	assert_false(has(maps, &b, ASSET_THICKNESS, 128));
	unsigned char hash[SCENE_MAP_HASH_BYTES];
	asset_hash_bytes(&a, hash);
	assert_int_equal(hash[0], 0xaa);
	assert_int_equal(hash[SCENE_MAP_HASH_BYTES - 1], 0xaa);
	asset_maps_destroy(maps);
}

static void test_maps_are_bounded(void **unused)
{
	(void)unused;
	enum { SIDE = 64, BYTES = SIDE * SIDE * 4 };
	struct asset_maps *maps = asset_maps_create(3 * BYTES + 5000);
	struct asset_file files[5];
	for (int i = 0; i < 5; i++)
		files[i] = file_of((char)('a' + i), SIDE);
	for (int i = 0; i < 3; i++)
		keep(maps, &files[i], ASSET_THICKNESS, SIDE);
	assert_true(has(maps, &files[0], ASSET_THICKNESS, SIDE)); /* used last */
	keep(maps, &files[3], ASSET_THICKNESS, SIDE);
	assert_true(has(maps, &files[0], ASSET_THICKNESS, SIDE));
	assert_false(has(maps, &files[1], ASSET_THICKNESS, SIDE));
	assert_true(asset_maps_bytes(maps) <= 3 * BYTES + 5000);

	/* What is held stays, and who wants more waits for it. */
	const struct scene_map *held[3];
	static const int which[] = {0, 2, 3};
	for (int i = 0; i < 3; i++)
		assert_non_null(held[i] = asset_maps_find(maps, &files[which[i]], ASSET_THICKNESS, SIDE));
	assert_false(asset_maps_make_room(maps, &files[4], ASSET_THICKNESS, SIDE, NULL));
	assert_false(asset_maps_make_room(maps, &files[4], ASSET_THICKNESS, SIDE, held[0]));
	scene_map_release(held[1]);
	assert_true(asset_maps_make_room(maps, &files[4], ASSET_THICKNESS, SIDE, NULL));
	assert_false(has(maps, &files[2], ASSET_THICKNESS, SIDE));
	scene_map_release(held[2]);
	/* One that alone is more than there may be is let in once no other is held. */
	assert_true(asset_maps_make_room(maps, &files[4], ASSET_ALBEDO, SIDE, held[0]));
	scene_map_release(held[0]);
	asset_maps_destroy(maps);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(test_names, open_store, close_store),
		cmocka_unit_test_setup_teardown(test_what_is_kept, open_store, close_store),
		cmocka_unit_test_setup_teardown(test_limits, open_store, close_store),
		cmocka_unit_test_setup_teardown(test_uploads_count_while_they_come_in, open_store, close_store),
		cmocka_unit_test_setup_teardown(test_uploads_are_shared, open_store, close_store),
		cmocka_unit_test_setup_teardown(test_conditions, open_store, close_store),
		cmocka_unit_test_setup_teardown(test_list, open_store, close_store),
		cmocka_unit_test_setup_teardown(test_killed, open_store, close_store),
		cmocka_unit_test_setup_teardown(test_sweep_spares_the_living, open_store, close_store),
		cmocka_unit_test_setup_teardown(test_many_at_once, open_store, close_store),
		cmocka_unit_test(test_maps_by_content_use_and_size),
		cmocka_unit_test(test_maps_are_bounded),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
