/* Droplet tables, and their files: bit by bit what was computed, or not believed. STRATUS_SLAB_DROPLETS: how many random distributions. */
#include "test_droplets_common.h"

#include "renderer/file_replace.h"
#include "renderer/optics/droplet_file.h"

#include <signal.h>
#include <sys/file.h>
#include <sys/wait.h>

static const struct scene_dsd example = {300, 2, 7};

static struct droplet_tables *create(const struct scene_dsd *dsd, int threads)
{
	struct droplet_tables *tables = droplet_tables_create(kernel, dsd, OPTICS_MIE, threads);
	assert_non_null(tables);
	return tables;
}

/* --- tables ----------------------------------------------------------------------------------------------------------------------- */

static void tables_are_what_their_parts_are(void **state)
{
	(void)state;
	struct droplet_tables *tables = create(&example, 2);
	struct optics *optics = optics_create(kernel, &example, OPTICS_MIE);
	struct slab_solution *slab = slab_solve(optics, 1);
	struct forward_tables *forward = malloc(sizeof *forward);
	assert_non_null(forward);
	forward_tables_compute(optics, forward);
	assert_memory_equal(tables->optics->extinction_per_m, optics->extinction_per_m, sizeof optics->extinction_per_m);
	assert_memory_equal(tables->optics->angle, optics->angle, (size_t)optics->angle_count * sizeof(double));
	for (int band = 0; band < BAND_COUNT; band++) {
		assert_memory_equal(tables->optics->phase[band], optics->phase[band], (size_t)optics->angle_count * sizeof(double));
		assert_memory_equal(tables->optics->moment_modified[band], optics->moment_modified[band],
				    (size_t)optics->moment_count * sizeof(double));
	}
	assert_true(memcmp(tables->slab, slab, sizeof *slab) == 0);
	assert_true(memcmp(tables->forward, forward, sizeof *forward) == 0);
	assert_true(tables->bytes > sizeof *slab && tables->bytes < sizeof *slab + (1 << 20));
	free(forward);
	slab_destroy(slab);
	optics_destroy(optics);
	droplet_tables_destroy(tables);
	droplet_tables_destroy(NULL);
}

static void phase_columns(void **state)
{
	(void)state;
	struct droplet_tables *tables = create(&example, 1);
	double before = -1;
	for (int i = 0; i < DROPLET_PHASE_COLUMNS; i++) {
		double angle = droplet_phase_angle(i, DROPLET_PHASE_COLUMNS);
		assert_true(angle > before && angle <= M_PI + 1e-12);
		before = angle;
		for (int band = 0; band < BAND_COUNT; band++) {
			assert_float_equal(exp2(tables->phase[0][i][band]) / optics_phase(tables->optics, band, angle), 1, 1e-5);
			assert_float_equal(exp2(tables->phase[1][i][band]) / optics_phase2(tables->optics, band, angle), 1, 1e-5);
		}
	}
	assert_true(droplet_phase_angle(0, DROPLET_PHASE_COLUMNS) == 0);
	assert_float_equal(before, M_PI, 1e-7);
	droplet_tables_destroy(tables);
}

static void threads_agree(void **state)
{
	(void)state;
	const struct scene_dsd broad = {10, 1, 30};
	struct droplet_tables *one = create(&broad, 1), *three = create(&broad, 3);
	assert_same_tables(one, three);
	droplet_tables_destroy(one);
	droplet_tables_destroy(three);
}

/* --- files ------------------------------------------------------------------------------------------------------------------------ */

struct written {
	char path[PATH_MAX];
	struct droplet_file file;
	struct droplet_tables *tables;
	off_t size;
};

static void write_tables(struct written *written, const struct scene_dsd *dsd)
{
	char name[DROPLET_NAME_SIZE];
	*written = (struct written){.tables = create(dsd, 2)};
	written->file = (struct droplet_file){written->path, droplet_key_make(DROPLET_TABLES, dsd, OPTICS_MIE), kernel_hash(kernel)};
	droplet_key_name(&written->file.key, name);
	snprintf(written->path, sizeof written->path, "%s/%s", folder, name);
	assert_true(droplet_file_write_tables(&written->file, written->tables));
	struct stat status;
	assert_int_equal(stat(written->path, &status), 0);
	assert_int_equal(status.st_mode & 0777, 0644);
	written->size = status.st_size;
	assert_int_equal(written->size, droplet_file_bytes(DROPLET_TABLES));
}

static enum droplet_file_state read_tables(const struct droplet_file *file)
{
	struct droplet_tables *tables = NULL;
	enum droplet_file_state state = droplet_file_read_tables(file, &tables);
	assert_true((state == DROPLET_FILE_GOOD) == (tables != NULL));
	droplet_tables_destroy(tables);
	return state;
}

/* What was measured so often. */
struct measured {
	double sum, worst;
};

static void measure(struct measured *measured, double value)
{
	measured->sum += value;
	measured->worst = fmax(measured->worst, value);
}

/* Every distribution comes back bit by bit, and soon. */
static void round_trips(void **state)
{
	(void)state;
	const char *wanted = getenv("STRATUS_SLAB_DROPLETS");
	int count = wanted ? atoi(wanted) : SLOWDOWN > 1 ? 2 : 6;
	struct measured wall = {0}, processors = {0}, read_wall = {0}, read_processor = {0};
	for (int i = 0; i < count; i++) {
		struct scene_dsd dsd = random_dsd();
		struct written written;
		double begin = clock_ms(CLOCK_MONOTONIC), begin_processors = clock_ms(CLOCK_PROCESS_CPUTIME_ID);
		struct droplet_tables *again = create(&dsd, 2), *back;
		measure(&wall, clock_ms(CLOCK_MONOTONIC) - begin);
		measure(&processors, clock_ms(CLOCK_PROCESS_CPUTIME_ID) - begin_processors);
		write_tables(&written, &dsd);
		begin = clock_ms(CLOCK_MONOTONIC);
		begin_processors = clock_ms(CLOCK_PROCESS_CPUTIME_ID);
		assert_int_equal(droplet_file_read_tables(&written.file, &back), DROPLET_FILE_GOOD);
		measure(&read_wall, clock_ms(CLOCK_MONOTONIC) - begin);
		measure(&read_processor, clock_ms(CLOCK_PROCESS_CPUTIME_ID) - begin_processors);
		assert_same_tables(written.tables, back);
		assert_same_tables(again, back);
		unlink(written.path);
		droplet_tables_destroy(back);
		droplet_tables_destroy(again);
		droplet_tables_destroy(written.tables);
	}
	print_message("%d distributions, mean and worst: computed in %.0f, %.0f ms (processors %.0f, %.0f); "
		      "read in %.1f, %.1f ms (processor %.1f, %.1f); %zu bytes each\n",
		      count, wall.sum / count, wall.worst, processors.sum / count, processors.worst, read_wall.sum / count, read_wall.worst,
		      read_processor.sum / count, read_processor.worst, droplet_file_bytes(DROPLET_TABLES));
}

static void flip(const char *path, off_t at, unsigned char bits)
{
	unsigned char byte;
	int fd = open(path, O_RDWR);
	assert_true(fd >= 0);
	assert_int_equal(pread(fd, &byte, 1, at), 1);
	byte ^= bits;
	assert_int_equal(pwrite(fd, &byte, 1, at), 1);
	close(fd);
}

/* Every byte of the header, and bits all over the rest. */
static void flipped_bits(void **state)
{
	(void)state;
	struct written written;
	write_tables(&written, &example);
	enum { HEADER = 88 };
	for (int i = 0; i < HEADER + 100; i++) {
		off_t at = i < HEADER ? i : HEADER + (off_t)(random_unit() * (double)(written.size - HEADER));
		unsigned char bits = (unsigned char)(1 << (int)(8 * random_unit()));
		flip(written.path, at, bits);
		if (read_tables(&written.file) != DROPLET_FILE_BAD)
			fail_msg("byte %ld was not missed", (long)at);
		flip(written.path, at, bits);
	}
	assert_int_equal(read_tables(&written.file), DROPLET_FILE_GOOD);
	droplet_tables_destroy(written.tables);
}

static void wrong_lengths(void **state)
{
	(void)state;
	struct written written;
	write_tables(&written, &example);
	off_t longer[] = {written.size + 1, written.size + 4096, written.size * 3};
	for (int i = 0; i < 3; i++) {
		assert_int_equal(truncate(written.path, longer[i]), 0);
		assert_int_equal(read_tables(&written.file), DROPLET_FILE_BAD);
	}
	for (off_t size = written.size - 1; size > 0; size = size < 200 ? size - 7 : (off_t)((double)size * 0.7)) {
		assert_int_equal(truncate(written.path, size), 0);
		assert_int_equal(read_tables(&written.file), DROPLET_FILE_BAD);
	}
	assert_int_equal(truncate(written.path, 0), 0);
	assert_int_equal(read_tables(&written.file), DROPLET_FILE_BAD);
	assert_int_equal(unlink(written.path), 0);
	assert_int_equal(read_tables(&written.file), DROPLET_FILE_ABSENT);
	droplet_tables_destroy(written.tables);
}

/* Sound, but of something else. */
static void foreign_files(void **state)
{
	(void)state;
	struct written written;
	write_tables(&written, &example);
	struct droplet_file other = written.file;
	other.kernel_hash++;
	assert_int_equal(read_tables(&other), DROPLET_FILE_BAD);
	other = written.file;
	other.key.model = OPTICS_PAPER;
	assert_int_equal(read_tables(&other), DROPLET_FILE_BAD);
	other = written.file;
	other.key.gamma = nextafter(other.key.gamma, 3);
	assert_int_equal(read_tables(&other), DROPLET_FILE_BAD);
	struct paper_fit_table fit;
	other = written.file;
	other.key.kind = DROPLET_FIT;
	assert_int_equal(droplet_file_read_fit(&other, &fit), DROPLET_FILE_BAD);
	assert_int_equal(read_tables(&written.file), DROPLET_FILE_GOOD);
	droplet_tables_destroy(written.tables);
}

/* None of these is read, waited for or followed; what can be replaced is. */
static void no_plain_files(void **state)
{
	(void)state;
	struct written written;
	char elsewhere[PATH_MAX];
	write_tables(&written, &example);
	snprintf(elsewhere, sizeof elsewhere, "%s/elsewhere", folder);
	assert_int_equal(rename(written.path, elsewhere), 0);
	assert_int_equal(symlink("elsewhere", written.path), 0);
	assert_int_equal(read_tables(&written.file), DROPLET_FILE_BAD);
	assert_true(droplet_file_write_tables(&written.file, written.tables));
	assert_int_equal(read_tables(&written.file), DROPLET_FILE_GOOD);
	unlink(written.path);
	assert_int_equal(mkfifo(written.path, 0600), 0);
	assert_int_equal(read_tables(&written.file), DROPLET_FILE_BAD);
	unlink(written.path);
	assert_int_equal(mkdir(written.path, 0700), 0);
	assert_int_equal(read_tables(&written.file), DROPLET_FILE_BAD);
	assert_false(droplet_file_write_tables(&written.file, written.tables));
	assert_int_equal(count_files(), 2); /* nothing is left of the attempt */
	droplet_tables_destroy(written.tables);
}

static void read_flipped(void *context)
{
	assert_int_equal(read_tables(context), DROPLET_FILE_BAD);
}

static void warning_names_file_and_reason(void **state)
{
	(void)state;
	struct written written;
	write_tables(&written, &example);
	flip(written.path, written.size / 2, 1);
	char *text = log_of(read_flipped, &written.file);
	assert_int_equal(count_lines(text, "\n"), 1);
	assert_non_null(strstr(text, " warning "));
	assert_non_null(strstr(text, written.path));
	assert_non_null(strstr(text, "damaged (checksum)"));
	free(text);
	droplet_tables_destroy(written.tables);
}

static void fits_round_trip(void **state)
{
	(void)state;
	char path[PATH_MAX];
	struct paper_fit_table fit, back;
	for (size_t i = 0; i < sizeof fit / sizeof(double); i++)
		((double *)&fit)[i] = random_unit();
	snprintf(path, sizeof path, "%s/fit", folder);
	struct droplet_file file = {path, droplet_key_make(DROPLET_FIT, &example, OPTICS_PAPER), kernel_hash(kernel)};
	assert_int_equal(droplet_file_read_fit(&file, &back), DROPLET_FILE_ABSENT);
	assert_true(droplet_file_write_fit(&file, &fit));
	assert_int_equal(droplet_file_read_fit(&file, &back), DROPLET_FILE_GOOD);
	assert_memory_equal(&fit, &back, sizeof fit);
	for (size_t at = 0; at < droplet_file_bytes(DROPLET_FIT); at++) {
		flip(path, (off_t)at, 0x40);
		assert_int_equal(droplet_file_read_fit(&file, &back), DROPLET_FILE_BAD);
		flip(path, (off_t)at, 0x40);
	}
	assert_int_equal(droplet_file_read_fit(&file, &back), DROPLET_FILE_GOOD);
}

static void names_differ(void **state)
{
	(void)state;
	char names[5][DROPLET_NAME_SIZE];
	const struct scene_dsd other = {300, 2, nextafter(7, 8)};
	const struct droplet_key keys[] = {
		droplet_key_make(DROPLET_TABLES, &example, OPTICS_MIE), droplet_key_make(DROPLET_TABLES, &example, OPTICS_PAPER),
		droplet_key_make(DROPLET_FIT, &example, OPTICS_MIE),    droplet_key_make(DROPLET_TABLES, &other, OPTICS_MIE),
		droplet_key_make(DROPLET_FIT, &other, OPTICS_MIE),
	};
	for (int i = 0; i < 5; i++) {
		droplet_key_name(&keys[i], names[i]);
		for (int j = 0; j < i; j++) {
			assert_string_not_equal(names[i], names[j]);
			assert_false(droplet_key_equal(&keys[i], &keys[j]));
		}
	}
}

/* --- processes that die ----------------------------------------------------------------------------------------------------------- */

static void count_temporary(const char *path, void *context)
{
	*(int *)context += strchr(path + sizeof folder, '.') != NULL;
}

static int count_temporaries(void)
{
	int count = 0;
	for_each_file(count_temporary, &count);
	return count;
}

/* A process that writes the same file for ever is killed at some moment, often: there is always a whole file, old or new. */
static void killed_while_writing(void **state)
{
	(void)state;
	struct written written;
	int left = 0;
	write_tables(&written, &example);
	for (int i = 0; i < 20 || (left == 0 && i < 1000); i++) { /* until it was killed in the middle */
		pid_t child = fork();
		assert_true(child >= 0);
		if (child == 0)
			for (;;)
				droplet_file_write_tables(&written.file, written.tables);
		usleep((useconds_t)(2000 + 40000 * random_unit()));
		kill(child, SIGKILL);
		assert_int_equal(waitpid(child, NULL, 0), child);
		left += count_temporaries();
		assert_int_equal(read_tables(&written.file), DROPLET_FILE_GOOD);
		file_replace_sweep(folder, DROPLET_NAME_PATTERN);
		assert_int_equal(count_temporaries(), 0);
		assert_int_equal(count_files(), 1);
	}
	assert_true(left > 0);
	droplet_tables_destroy(written.tables);
}

static int touch_file(const char *name)
{
	char path[PATH_MAX];
	snprintf(path, sizeof path, "%s/%s", folder, name);
	int fd = open(path, O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
	assert_true(fd >= 0);
	return fd;
}

static void sweep_spares_others(void **state)
{
	(void)state;
	const char name[] = "tables-0123456789abcdef0123456789abcdef", left[] = "tables-0123456789abcdef0123456789abcdef.a1B2c3";
	close(touch_file(name));
	close(touch_file(left));
	close(touch_file("mie.kernel"));
	close(touch_file("notes.backup"));
	int writer = touch_file("fit-0123456789abcdef0123456789abcdef.zzzzzz");
	assert_int_equal(flock(writer, LOCK_EX), 0);
	file_replace_sweep(folder, DROPLET_NAME_PATTERN);
	assert_int_equal(count_files(), 4);
	close(writer); /* died */
	file_replace_sweep(folder, DROPLET_NAME_PATTERN);
	assert_int_equal(count_files(), 3);
	file_replace_sweep("/nonexistent", DROPLET_NAME_PATTERN);
}

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_folder, remove_folder)

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(tables_are_what_their_parts_are),
		cmocka_unit_test(phase_columns),
		cmocka_unit_test(threads_agree),
		IN_FOLDER(round_trips),
		IN_FOLDER(flipped_bits),
		IN_FOLDER(wrong_lengths),
		IN_FOLDER(foreign_files),
		IN_FOLDER(no_plain_files),
		IN_FOLDER(warning_names_file_and_reason),
		IN_FOLDER(fits_round_trip),
		cmocka_unit_test(names_differ),
		IN_FOLDER(killed_while_writing),
		IN_FOLDER(sweep_spares_others),
	};
	int status = load_kernel();
	if (status == 0)
		status = cmocka_run_group_tests(tests, NULL, NULL);
	kernel_destroy(kernel);
	return status;
}
