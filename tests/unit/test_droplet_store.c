/* The store of droplet tables: computed once, found again in memory and on disk, bounded in both. */
#include "test_droplets_common.h"

#include "renderer/droplet_store.h"
#include "renderer/optics/droplet_file.h"

#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>

/* Narrow distributions are solved soonest. */
static struct scene_dsd droplets(int number)
{
	return (struct scene_dsd){100 + number, 12, 6};
}

#define TABLES_BYTES sizeof(struct droplet_storage)

static struct droplet_store *create(const char *directory, double tables_in_memory, double files_on_disk)
{
	const struct droplet_store_params params = {
		.kernel = kernel,
		.directory = directory,
		.memory_bytes = (size_t)(tables_in_memory * (double)TABLES_BYTES),
		.disk_bytes = (uint64_t)(files_on_disk * (double)droplet_file_bytes(DROPLET_TABLES)),
		.threads = 2,
	};
	struct droplet_store *store = droplet_store_create(&params);
	assert_non_null(store);
	return store;
}

static const struct droplet_tables *get(struct droplet_store *store, int number, enum droplet_source expected)
{
	enum droplet_source source;
	struct scene_dsd dsd = droplets(number);
	const struct droplet_tables *tables = droplet_store_get(store, &dsd, OPTICS_MIE, &source);
	assert_non_null(tables);
	assert_int_equal(source, expected);
	return tables;
}

/* Got and given back. */
static void use(struct droplet_store *store, int number, enum droplet_source expected)
{
	droplet_store_release(store, get(store, number, expected));
}

static bool has(struct droplet_store *store, int number)
{
	struct scene_dsd dsd = droplets(number);
	return droplet_store_has(store, &dsd, OPTICS_MIE, false);
}

/* --- where they come from --------------------------------------------------------------------------------------------------------- */

static void computed_then_found(void **state)
{
	(void)state;
	struct droplet_store *store = create(folder, 2, 4);
	assert_false(has(store, 1));
	const struct droplet_tables *first = get(store, 1, DROPLETS_COMPUTED);
	assert_true(has(store, 1));
	assert_false(has(store, 2));
	assert_ptr_equal(get(store, 1, DROPLETS_FROM_MEMORY), first);
	struct scene_dsd dsd = droplets(1);
	struct droplet_tables *computed = droplet_tables_create(kernel, &dsd, OPTICS_MIE, 1);
	assert_same_tables(first, computed);
	droplet_store_release(store, first);
	droplet_store_release(store, first);
	droplet_store_destroy(store);

	store = create(folder, 2, 4);
	assert_false(has(store, 1));
	const struct droplet_tables *read = get(store, 1, DROPLETS_FROM_DISK);
	assert_same_tables(read, computed);
	droplet_store_release(store, read);
	droplet_store_release(store, NULL);
	struct droplet_store_counts counts = droplet_store_counts(store);
	assert_int_equal(counts.from[DROPLETS_FROM_DISK], 1);
	assert_int_equal(counts.from[DROPLETS_COMPUTED] + counts.from[DROPLETS_FROM_MEMORY] + counts.damaged_files, 0);
	assert_int_equal(counts.memory_bytes, TABLES_BYTES);
	droplet_store_destroy(store);
	droplet_store_destroy(NULL);
	droplet_tables_destroy(computed);
}

static struct paper_fit_table get_fit(struct droplet_store *store, int number, enum droplet_source expected)
{
	enum droplet_source source;
	struct scene_dsd dsd = droplets(number);
	struct paper_fit_table fit;
	assert_true(droplet_store_get_fit(store, &dsd, OPTICS_MIE, &fit, &source));
	assert_int_equal(source, expected);
	return fit;
}

/* As the tables, whose own way in is the solved slab. */
static void fits_likewise(void **state)
{
	(void)state;
	struct scene_dsd dsd = droplets(1);
	struct droplet_store *store = create(folder, 2, 4);
	const struct droplet_tables *tables = get(store, 1, DROPLETS_COMPUTED);
	assert_false(droplet_store_has(store, &dsd, OPTICS_MIE, true));
	struct paper_fit_table fit = get_fit(store, 1, DROPLETS_COMPUTED), expected;
	assert_true(paper_fit_table_compute(tables->optics, tables->slab, 1, &expected));
	assert_memory_equal(&fit, &expected, sizeof fit);
	assert_true(droplet_store_has(store, &dsd, OPTICS_MIE, true));
	fit = get_fit(store, 1, DROPLETS_FROM_MEMORY);
	assert_memory_equal(&fit, &expected, sizeof fit);
	droplet_store_release(store, tables);
	droplet_store_destroy(store);
	assert_int_equal(count_files(), 2);

	store = create(folder, 2, 4);
	fit = get_fit(store, 1, DROPLETS_FROM_DISK); /* without the tables */
	assert_memory_equal(&fit, &expected, sizeof fit);
	assert_false(has(store, 1));
	assert_int_equal(droplet_store_counts(store).memory_bytes, sizeof fit);
	get_fit(store, 2, DROPLETS_COMPUTED); /* brings them */
	assert_true(has(store, 2));
	droplet_store_destroy(store);
	assert_int_equal(count_files(), 4);
}

static void models_are_kept_apart(void **state)
{
	(void)state;
	struct droplet_store *store = create(NULL, 4, 0);
	struct scene_dsd dsd = droplets(1);
	enum droplet_source source;
	const struct droplet_tables *mie = get(store, 1, DROPLETS_COMPUTED);
	const struct droplet_tables *paper = droplet_store_get(store, &dsd, OPTICS_PAPER, &source);
	assert_non_null(paper);
	assert_int_equal(source, DROPLETS_COMPUTED);
	assert_true(mie->optics->extinction_per_m[0] != paper->optics->extinction_per_m[0]);
	droplet_store_release(store, mie);
	droplet_store_release(store, paper);
	droplet_store_destroy(store);
}

/* Bounds far above what the figures should be, so that only a mistake exceeds them: a busy machine must not. */
static void times(void **state)
{
	(void)state;
	enum { READS = 8, ASKS = 1000 };
	double disk = 1e9, disk_mean = 0, memory = 0;
	struct droplet_store *store = create(folder, 2, 4);
	use(store, 1, DROPLETS_COMPUTED);
	droplet_store_destroy(store);
	for (int i = 0; i < READS; i++) {
		store = create(folder, 2, 4);
		double begin = clock_ms(CLOCK_THREAD_CPUTIME_ID);
		use(store, 1, DROPLETS_FROM_DISK);
		double took = clock_ms(CLOCK_THREAD_CPUTIME_ID) - begin;
		disk = fmin(disk, took);
		disk_mean += took / READS;
		begin = clock_ms(CLOCK_THREAD_CPUTIME_ID);
		for (int k = 0; k < ASKS; k++)
			use(store, 1, DROPLETS_FROM_MEMORY);
		memory = (clock_ms(CLOCK_THREAD_CPUTIME_ID) - begin) / ASKS;
		droplet_store_destroy(store);
	}
	print_message("from disk %.2f ms (mean %.2f), from memory %.5f ms of processor time\n", disk, disk_mean, memory);
	assert_true(disk < 50 * SLOWDOWN);
	assert_true(memory < 1 * SLOWDOWN);
}

/* --- together --------------------------------------------------------------------------------------------------------------------- */

struct asker {
	pthread_t thread;
	struct droplet_store *store;
	int number;
	const struct droplet_tables *tables;
};

static void *ask(void *argument)
{
	struct asker *asker = argument;
	struct scene_dsd dsd = droplets(asker->number);
	asker->tables = droplet_store_get(asker->store, &dsd, OPTICS_MIE, NULL);
	return NULL;
}

/* 8 at once for `distinct` distributions; returns how many were computed. */
static uint64_t ask_together(struct droplet_store *store, int first, int distinct)
{
	struct asker askers[8];
	uint64_t before = droplet_store_counts(store).from[DROPLETS_COMPUTED];
	for (int i = 0; i < 8; i++) {
		askers[i] = (struct asker){.store = store, .number = first + i % distinct};
		assert_int_equal(pthread_create(&askers[i].thread, NULL, ask, &askers[i]), 0);
	}
	for (int i = 0; i < 8; i++)
		pthread_join(askers[i].thread, NULL);
	for (int i = 0; i < 8; i++) {
		assert_non_null(askers[i].tables);
		assert_ptr_equal(askers[i].tables, askers[i % distinct].tables);
	}
	for (int i = 0; i < 8; i++)
		droplet_store_release(store, askers[i].tables);
	return droplet_store_counts(store).from[DROPLETS_COMPUTED] - before;
}

static void computed_once(void **state)
{
	(void)state;
	struct droplet_store *store = create(folder, 8, 8);
	assert_int_equal(ask_together(store, 1, 1), 1);
	assert_int_equal(ask_together(store, 2, 3), 3);
	assert_int_equal(ask_together(store, 1, 4), 0);
	struct droplet_store_counts counts = droplet_store_counts(store);
	assert_int_equal(counts.from[DROPLETS_FROM_MEMORY], 20);
	assert_int_equal(counts.memory_bytes, 4 * TABLES_BYTES);
	droplet_store_destroy(store);
	assert_int_equal(count_files(), 4);
}

/* Reading and evicting all the time, from all sides. */
static void *ask_often(void *argument)
{
	struct asker *asker = argument;
	unsigned seed = (unsigned)asker->number;
	for (int i = 0; i < 40; i++) {
		struct scene_dsd dsd = droplets(1 + (int)(rand_r(&seed) % 3));
		const struct droplet_tables *tables = i % 4 ? droplet_store_get(asker->store, &dsd, OPTICS_MIE, NULL)
							    : droplet_store_find(asker->store, &dsd, OPTICS_MIE);
		if (tables && tables->optics->extinction_per_m[0] > 0)
			asker->tables = tables;
		droplet_store_await_room(asker->store, 1);
		droplet_store_has(asker->store, &dsd, OPTICS_MIE, true);
		droplet_store_release(asker->store, tables);
	}
	return NULL;
}

static void in_every_order(void **state)
{
	(void)state;
	struct droplet_store *store = create(folder, 1.5, 8);
	struct asker askers[4];
	for (int i = 0; i < 4; i++) {
		askers[i] = (struct asker){.store = store, .number = i};
		assert_int_equal(pthread_create(&askers[i].thread, NULL, ask_often, &askers[i]), 0);
	}
	for (int i = 0; i < 4; i++) {
		pthread_join(askers[i].thread, NULL);
		assert_non_null(askers[i].tables);
	}
	droplet_store_destroy(store);
}

/* --- bounds ----------------------------------------------------------------------------------------------------------------------- */

static void memory_is_bounded(void **state)
{
	(void)state;
	struct droplet_store *store = create(NULL, 2.5, 0);
	const struct droplet_tables *held = get(store, 1, DROPLETS_COMPUTED);
	use(store, 2, DROPLETS_COMPUTED);
	use(store, 3, DROPLETS_COMPUTED); /* puts 2 out, since 1 is held */
	assert_true(has(store, 1) && !has(store, 2) && has(store, 3));
	assert_int_equal(droplet_store_counts(store).memory_bytes, 2 * TABLES_BYTES);
	droplet_store_release(store, held);
	use(store, 3, DROPLETS_FROM_MEMORY);
	use(store, 4, DROPLETS_COMPUTED); /* puts 1 out, whose use is longest ago */
	assert_true(!has(store, 1) && has(store, 3) && has(store, 4));
	droplet_store_destroy(store);

	store = create(NULL, 0.5, 0); /* too small for any: held and then gone */
	held = get(store, 1, DROPLETS_COMPUTED);
	assert_ptr_equal(get(store, 1, DROPLETS_FROM_MEMORY), held);
	droplet_store_release(store, held);
	assert_true(has(store, 1));
	droplet_store_release(store, held);
	assert_false(has(store, 1));
	assert_int_equal(droplet_store_counts(store).memory_bytes, 0);
	droplet_store_destroy(store);
}

static void *release_later(void *argument)
{
	struct asker *asker = argument;
	usleep(20000);
	droplet_store_release(asker->store, asker->tables);
	return NULL;
}

static void room_for_holders(void **state)
{
	(void)state;
	struct droplet_store *store = create(NULL, 2.5, 0);
	struct scene_dsd dsd[] = {droplets(1), droplets(2), droplets(3)};
	assert_null(droplet_store_find(store, &dsd[0], OPTICS_MIE));
	struct asker holder = {.store = store, .tables = get(store, 1, DROPLETS_COMPUTED)};
	assert_true(droplet_store_await_room(store, 0));
	use(store, 2, DROPLETS_COMPUTED);
	const struct droplet_tables *second = droplet_store_find(store, &dsd[1], OPTICS_MIE);
	assert_non_null(second);
	assert_false(droplet_store_await_room(store, 5));
	const struct droplet_tables *third = get(store, 3, DROPLETS_COMPUTED); /* who insists gets it */
	droplet_store_release(store, second);
	assert_null(droplet_store_find(store, &dsd[1], OPTICS_MIE)); /* gone: three were more than the bound */
	const struct droplet_tables *again = droplet_store_find(store, &dsd[2], OPTICS_MIE);
	assert_ptr_equal(again, third); /* held already, so it costs nothing */
	droplet_store_release(store, again);
	assert_int_equal(pthread_create(&holder.thread, NULL, release_later, &holder), 0);
	assert_true(droplet_store_await_room(store, 60000));
	pthread_join(holder.thread, NULL);
	droplet_store_release(store, third);
	droplet_store_destroy(store);
}

static void path_of(int number, char path[static PATH_MAX])
{
	char name[DROPLET_NAME_SIZE];
	struct scene_dsd dsd = droplets(number);
	struct droplet_key key = droplet_key_make(DROPLET_TABLES, &dsd, OPTICS_MIE);
	droplet_key_name(&key, name);
	snprintf(path, PATH_MAX, "%s/%s", folder, name);
}

static bool on_disk(int number)
{
	char path[PATH_MAX];
	path_of(number, path);
	return access(path, R_OK) == 0;
}

/* Pretends that the file was used so long ago. */
static void set_age(int number, int seconds)
{
	char path[PATH_MAX];
	struct timespec now, times[2];
	path_of(number, path);
	clock_gettime(CLOCK_REALTIME, &now);
	times[0] = times[1] = (struct timespec){.tv_sec = now.tv_sec - seconds};
	assert_int_equal(utimensat(AT_FDCWD, path, times, 0), 0);
}

static void disk_is_bounded(void **state)
{
	(void)state;
	struct droplet_store *store = create(folder, 8, 2.5);
	use(store, 1, DROPLETS_COMPUTED);
	use(store, 2, DROPLETS_COMPUTED);
	droplet_store_destroy(store);
	assert_true(on_disk(1) && on_disk(2));
	set_age(1, 200);
	set_age(2, 100);

	store = create(folder, 8, 2.5);
	use(store, 1, DROPLETS_FROM_DISK); /* used now, so 2 is the older one */
	use(store, 3, DROPLETS_COMPUTED);
	droplet_store_destroy(store);
	assert_true(on_disk(1) && !on_disk(2) && on_disk(3));

	set_age(1, 100);
	droplet_store_destroy(create(folder, 8, 1.5)); /* a smaller bound is enforced from the start */
	assert_true(!on_disk(1) && on_disk(3));

	store = create(folder, 8, 0.5);
	use(store, 1, DROPLETS_COMPUTED);
	droplet_store_destroy(store);
	assert_int_equal(count_files(), 0);
}

/* --- trouble ---------------------------------------------------------------------------------------------------------------------- */

static void damage(const char *path, void *context)
{
	(void)context;
	int fd = open(path, O_WRONLY);
	assert_int_equal(pwrite(fd, "x", 1, 5000000), 1);
	close(fd);
}

static void ask_for_damaged(void *context)
{
	use(context, 1, DROPLETS_COMPUTED);
	use(context, 1, DROPLETS_FROM_MEMORY);
}

static void damaged_file_is_replaced(void **state)
{
	(void)state;
	struct droplet_store *store = create(folder, 2, 4);
	use(store, 1, DROPLETS_COMPUTED);
	droplet_store_destroy(store);
	for_each_file(damage, NULL);

	store = create(folder, 2, 4);
	char *text = log_of(ask_for_damaged, store), path[PATH_MAX];
	path_of(1, path);
	assert_int_equal(count_lines(text, "\n"), 1);
	assert_non_null(strstr(text, path));
	free(text);
	assert_int_equal(droplet_store_counts(store).damaged_files, 1);
	droplet_store_destroy(store);

	store = create(folder, 2, 4);
	use(store, 1, DROPLETS_FROM_DISK);
	assert_int_equal(droplet_store_counts(store).damaged_files, 0);
	droplet_store_destroy(store);
}

/* With a store of two distributions whose disk takes none of them. */
static void use_without_disk(void *context)
{
	struct droplet_store *store = create(context, 4, 4);
	use(store, 1, DROPLETS_COMPUTED);
	use(store, 2, DROPLETS_COMPUTED);
	use(store, 1, DROPLETS_FROM_MEMORY);
	droplet_store_destroy(store);
}

static void disk_that_fails_costs_a_warning(void **state)
{
	(void)state;
	char file[PATH_MAX], below[PATH_MAX + 16], missing[PATH_MAX + 16];
	snprintf(file, sizeof file, "%s/file", folder);
	snprintf(below, sizeof below, "%s/droplets", file);
	snprintf(missing, sizeof missing, "%s/a/b", folder);
	fclose(fopen(file, "w"));
	char *text = log_of(use_without_disk, below);
	assert_int_equal(count_lines(text, "\n"), 1);
	assert_int_equal(count_lines(text, " warning "), 1);
	assert_non_null(strstr(text, "Not a directory"));
	free(text);
	remove(file);

	/* As full as a disk can be made without one. */
	struct rlimit before, limit;
	assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
	signal(SIGXFSZ, SIG_IGN);
	limit = (struct rlimit){5000000, before.rlim_max};
	assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
	text = log_of(use_without_disk, folder);
	assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
	assert_int_equal(count_lines(text, "\n"), 1);
	assert_non_null(strstr(text, "File too large"));
	assert_int_equal(count_files(), 0);
	free(text);

	text = log_of(use_without_disk, missing); /* made */
	assert_string_equal(text, "");
	free(text);
	for (int i = 1; i <= 2; i++) {
		char name[DROPLET_NAME_SIZE], path[PATH_MAX + 64];
		struct scene_dsd dsd = droplets(i);
		struct droplet_key key = droplet_key_make(DROPLET_TABLES, &dsd, OPTICS_MIE);
		droplet_key_name(&key, name);
		snprintf(path, sizeof path, "%s/%s", missing, name);
		assert_int_equal(unlink(path), 0);
	}
	rmdir(missing);
}

static void too_long_a_path(void **state)
{
	(void)state;
	char path[PATH_MAX + 100];
	memset(path, 'x', sizeof path - 1);
	path[0] = '/';
	path[sizeof path - 1] = '\0';
	char *text = log_of(use_without_disk, path);
	assert_int_equal(count_lines(text, "\n"), 1);
	free(text);
}

static void leftovers_go_at_start(void **state)
{
	(void)state;
	char path[PATH_MAX];
	path_of(1, path);
	strcat(path, ".AbCdEf");
	fclose(fopen(path, "w"));
	droplet_store_destroy(create(folder, 2, 4));
	assert_int_equal(count_files(), 0);
}

/* Droplets that are none: an error for all who asked, and for none after them. */
static void *ask_for_nothing(void *argument)
{
	struct asker *asker = argument;
	const struct scene_dsd nothing = {100, NAN, 6};
	asker->tables = droplet_store_get(asker->store, &nothing, OPTICS_MIE, NULL);
	return NULL;
}

static void fail_together(void *context)
{
	struct asker askers[4];
	for (int i = 0; i < 4; i++) {
		askers[i] = (struct asker){.store = context};
		assert_int_equal(pthread_create(&askers[i].thread, NULL, ask_for_nothing, &askers[i]), 0);
	}
	for (int i = 0; i < 4; i++) {
		pthread_join(askers[i].thread, NULL);
		assert_null(askers[i].tables);
	}
}

static void failures(void **state)
{
	(void)state;
	struct droplet_store *store = create(folder, 2, 4);
	char *text = log_of(fail_together, store);
	assert_true(count_lines(text, " error ") >= 1);
	free(text);
	assert_int_equal(droplet_store_counts(store).memory_bytes, 0);
	use(store, 1, DROPLETS_COMPUTED);
	droplet_store_destroy(store);
	assert_int_equal(count_files(), 1);
}

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_folder, remove_folder)

int main(void)
{
	const struct CMUnitTest tests[] = {
		IN_FOLDER(computed_then_found),
		IN_FOLDER(fits_likewise),
		cmocka_unit_test(models_are_kept_apart),
		IN_FOLDER(times),
		IN_FOLDER(computed_once),
		IN_FOLDER(in_every_order),
		cmocka_unit_test(memory_is_bounded),
		cmocka_unit_test(room_for_holders),
		IN_FOLDER(disk_is_bounded),
		IN_FOLDER(damaged_file_is_replaced),
		IN_FOLDER(disk_that_fails_costs_a_warning),
		cmocka_unit_test(too_long_a_path),
		IN_FOLDER(leftovers_go_at_start),
		IN_FOLDER(failures),
	};
	int status = load_kernel();
	if (status == 0)
		status = cmocka_run_group_tests(tests, NULL, NULL);
	kernel_destroy(kernel);
	return status;
}
