/* The process that decodes: it finds what the decoder itself finds, and whatever a picture makes its libraries do ends that process alone,
 * in bounded time, and is told from the picture's faults. This program is both sides: started anew with the flag of such a process it
 * decodes with libraries that misbehave as the width of the picture says. */
#include "picture_bytes.h"

#include "renderer/image/image.h"
#include "server/clock.h"
#include "server/decoder.h"
#include "server/decoder_process.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
enum { MEMORY_IS_BOUND = 0 };
#else
enum { MEMORY_IS_BOUND = 1 };
#endif

static const unsigned char hash[SCENE_MAP_HASH_BYTES] = {7};
enum { LONG_MS = 100000 };

/* --- the other side --------------------------------------------------------------------------------------------------------------- */

enum behaviour { HONEST = 2, ABORTS, SPINS, SLEEPS, GROWS, ESCAPES, LEAVES, SKIPS, IS_SLOW };

static bool try_to_escape(int fd, char *error, size_t size)
{
	const char *way = NULL;
	signal(SIGXFSZ, SIG_IGN); /* else writing is the end */
	if (open("/etc/passwd", O_RDONLY) >= 0 || errno != EPERM)
		way = "open";
	if (socket(AF_INET, SOCK_STREAM, 0) >= 0)
		way = "socket";
	if (fork() >= 0)
		way = "fork";
	if (kill(getppid(), 0) == 0 || syscall(SYS_tgkill, getppid(), getppid(), 0) == 0)
		way = "kill";
	if (prlimit(getppid(), RLIMIT_NOFILE, NULL, &(struct rlimit){0}) == 0)
		way = "limits of others";
	if (execl("/bin/true", "true", NULL) == 0 || errno != EPERM)
		way = "exec";
	if (unlink("/tmp/nothing") == 0 || errno != EPERM)
		way = "unlink";
	if (mmap(NULL, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) != MAP_FAILED)
		way = "machine code";
	if (pwrite(fd, "x", 1, 0) >= 0 || write(fd, "x", 1) >= 0)
		way = "the picture";
	for (int other = 3; other < 1024; other++)
		if (other != fd && write(other, "x", 1) >= 0 && lseek(other, 0, SEEK_CUR) < 0)
			way = "a descriptor";
	snprintf(error, size, "%s", way ? way : "none");
	return false;
}

static bool misbehave(int fd, const struct picture_file *file, image_rows_taker *take, void *context, char *error, size_t error_size)
{
	float values[64];
	for (int i = 0; i < 64; i++)
		values[i] = 0.25f;
	const struct image_rows rows = {.count = 1, .channels = 1, .values = values};
	const struct timespec second = {.tv_sec = 1}, moment = {.tv_sec = 2};
	switch ((enum behaviour)file->width) {
	case ABORTS:
		abort();
	case SPINS:
		for (volatile unsigned i = 0;; i++)
			;
	case SLEEPS:
		for (;;)
			nanosleep(&second, NULL);
	case GROWS:
		for (size_t taken = 0; taken < (size_t)8 << 30; taken += 16 << 20)
			if (!memset(malloc(16 << 20), 1, 16 << 20))
				break;
		break;
	case ESCAPES:
		return try_to_escape(fd, error, error_size);
	case LEAVES:
		_exit(0);
	case SKIPS:
		return true;
	case IS_SLOW:
		nanosleep(&moment, NULL);
		return take(context, &rows);
	case HONEST:
		return take(context, &rows);
	}
	snprintf(error, error_size, "odd");
	return false;
}

/* --- this side -------------------------------------------------------------------------------------------------------------------- */

static struct decoder *decoder;

static int picture_of(int width)
{
	const unsigned char row[64] = {0};
	struct file_bytes png = png_of(width, 1, 8, 0, row);
	const int fd = memfd_create("picture", MFD_CLOEXEC);
	assert_true(fd >= 0);
	assert_int_equal(write(fd, png.data, png.size), png.size);
	bytes_finish(&png);
	return fd;
}

static enum decoder_result examine_within(int width, double milliseconds, char error[static 256])
{
	struct asset_facts facts;
	const int fd = picture_of(width);
	const off_t size = lseek(fd, 0, SEEK_END);
	error[0] = '\0';
	const enum decoder_result result = decoder_examine(decoder, fd, (uint64_t)size, clock_now_ms() + milliseconds, &facts, error, 256);
	if (result == DECODER_OK)
		assert_float_equal(facts.lowest[ASSET_THICKNESS], 0.25f, 0);
	close(fd);
	return result;
}

static void assert_refused(int width, const char *words)
{
	char error[256];
	assert_int_equal(examine_within(width, LONG_MS, error), DECODER_REFUSED);
	if (!strstr(error, words))
		fail_msg("\"%s\" does not say \"%s\"", error, words);
	assert_int_equal(examine_within(HONEST, LONG_MS, error), DECODER_OK);
}

static int start_with(uint32_t wall_ms)
{
	const struct decoder_limits limits = {.process = {.memory_bytes = 256 << 20, .cpu_seconds = 1}, .wall_ms = wall_ms};
	decoder = decoder_create("", &limits);
	return decoder ? 0 : 1;
}

static int start(void **state)
{
	(void)state;
	return start_with(60000);
}

static int start_with_little_time(void **state)
{
	(void)state;
	return start_with(1000);
}

static int stop(void **state)
{
	(void)state;
	decoder_destroy(decoder);
	return 0;
}

static void test_faults_of_libraries(void **state)
{
	(void)state;
	assert_refused(ABORTS, "makes its decoder fail");
	assert_refused(LEAVES, "makes its decoder fail");
	assert_refused(SKIPS, "makes its decoder fail");
	assert_refused(SPINS, "more than 1 s of a processor");
	if (MEMORY_IS_BOUND)
		assert_refused(GROWS, "makes its decoder fail");
}

static void test_time(void **state)
{
	char error[256];
	(void)state;
	assert_int_equal(examine_within(SLEEPS, LONG_MS, error), DECODER_REFUSED);
	assert_non_null(strstr(error, "longer than 1 s"));
}

static void test_no_way_out(void **state)
{
	(void)state;
	assert_refused(ESCAPES, "cannot be read: none");
}

static void test_deadline(void **state)
{
	char error[256];
	(void)state;
	assert_int_equal(examine_within(HONEST, LONG_MS, error), DECODER_OK); /* the process is there */
	const double begin = clock_now_ms();
	assert_int_equal(examine_within(SLEEPS, 300, error), DECODER_LATE);
	assert_true(clock_now_ms() - begin < 50000); /* or it was the decoder's own limit, of a minute */
	assert_int_equal(examine_within(HONEST, -1, error), DECODER_LATE);
	assert_int_equal(examine_within(HONEST, LONG_MS, error), DECODER_OK);
}

/* The one child of a process; 0: there is none. */
static pid_t child_of(pid_t process)
{
	char path[64];
	int child = 0;
	snprintf(path, sizeof path, "/proc/%d/task/%d/children", (int)process, (int)process);
	FILE *file = fopen(path, "r");
	if (!file)
		return 0;
	if (fscanf(file, "%d", &child) != 1)
		child = 0;
	fclose(file);
	return child;
}

static pid_t child_process(void)
{
	return child_of(getpid());
}

/* A copy of it has the picture in work. */
static void *kill_at_work(void *context)
{
	const pid_t process = *(const pid_t *)context;
	const struct timespec moment = {.tv_nsec = 1000000};
	while (!child_of(process))
		nanosleep(&moment, NULL);
	kill(process, SIGKILL);
	return NULL;
}

static void test_process_is_replaced(void **state)
{
	char error[256];
	(void)state;
	assert_int_equal(examine_within(HONEST, LONG_MS, error), DECODER_OK);
	pid_t first = child_process();
	assert_int_equal(examine_within(ABORTS, LONG_MS, error), DECODER_REFUSED);
	assert_int_equal(child_process(), first); /* it is the copy that dies */
	/* Killed while it waits: nobody notices. */
	kill(first, SIGKILL);
	siginfo_t ended;
	assert_int_equal(waitid(P_PID, (id_t)first, &ended, WEXITED | WNOWAIT), 0);
	assert_int_equal(examine_within(HONEST, LONG_MS, error), DECODER_OK);
	const pid_t second = child_process();
	assert_true(second > 0 && second != first);
	/* Killed at work: another begins anew. */
	pthread_t killer;
	assert_int_equal(pthread_create(&killer, NULL, kill_at_work, (void *)&second), 0);
	assert_int_equal(examine_within(IS_SLOW, LONG_MS, error), DECODER_OK);
	pthread_join(killer, NULL);
	assert_int_not_equal(child_process(), second);
}

static void *give_up_soon(void *context)
{
	const struct timespec moment = {.tv_nsec = 300000000};
	(void)context;
	nanosleep(&moment, NULL);
	decoder_give_up(decoder);
	return NULL;
}

static void test_giving_up(void **state)
{
	char error[256];
	pthread_t other;
	(void)state;
	assert_int_equal(examine_within(HONEST, LONG_MS, error), DECODER_OK);
	const pid_t process = child_process();
	const double begin = clock_now_ms();
	assert_int_equal(pthread_create(&other, NULL, give_up_soon, NULL), 0);
	assert_int_equal(examine_within(SLEEPS, LONG_MS, error), DECODER_LATE);
	pthread_join(other, NULL);
	assert_true(clock_now_ms() - begin < 50000);
	assert_int_equal(kill(process, 0), -1);
	assert_int_equal(examine_within(HONEST, LONG_MS, error), DECODER_LATE);
}

static int open_descriptors(void)
{
	int count = 0;
	DIR *folder = opendir("/proc/self/fd");
	while (readdir(folder))
		count++;
	closedir(folder);
	return count;
}

static void test_nothing_is_left(void **state)
{
	char error[256];
	(void)state;
	assert_int_equal(examine_within(HONEST, LONG_MS, error), DECODER_OK);
	const int open_before = open_descriptors();
	for (int i = 0; i < 10; i++) {
		examine_within(HONEST, LONG_MS, error);
		examine_within(ABORTS, LONG_MS, error);
		examine_within(IS_SLOW, 50, error);
	}
	assert_int_equal(open_descriptors(), open_before);
	const pid_t process = child_process();
	decoder_destroy(decoder);
	assert_int_equal(kill(process, 0), -1);
	assert_int_equal(open_descriptors(), open_before - 1);
	decoder = NULL;
}

static void *examine_many(void *context)
{
	char error[256];
	for (int i = 0; i < 20; i++) {
		*(bool *)context &= examine_within(HONEST, LONG_MS, error) == DECODER_OK;
		*(bool *)context &= examine_within(ABORTS, LONG_MS, error) == DECODER_REFUSED;
	}
	return NULL;
}

static void test_from_many_threads(void **state)
{
	pthread_t threads[4];
	bool good[4] = {true, true, true, true};
	(void)state;
	for (int i = 0; i < 4; i++)
		assert_int_equal(pthread_create(&threads[i], NULL, examine_many, &good[i]), 0);
	for (int i = 0; i < 4; i++) {
		pthread_join(threads[i], NULL);
		assert_true(good[i]);
	}
}

/* --- with the libraries themselves ---------------------------------------------------------------------------------------------------- */

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

static void compare_with_this_process(const struct image_api *images, struct file_bytes bytes, int side)
{
	struct asset_facts here = {0}, there = {0};
	char error[256] = "";
	const int fd = memfd_create("picture", MFD_CLOEXEC);
	assert_int_equal(write(fd, bytes.data, bytes.size), bytes.size);
	assert_true(asset_examine(images, fd, bytes.size, &here, error, sizeof error));
	if (decoder_examine(decoder, fd, bytes.size, INFINITY, &there, error, sizeof error) != DECODER_OK)
		fail_msg("%s", error);
	assert_memory_equal(&here, &there, sizeof here);
	for (enum asset_use use = 0; use < ASSET_USE_COUNT; use++) {
		struct scene_map *mine = asset_decode(images, fd, bytes.size, use, side, hash, error, sizeof error), *its;
		assert_int_equal(decoder_read_map(decoder, fd, bytes.size, INFINITY, &there, use, side, hash, &its, error, sizeof error),
				 DECODER_OK);
		assert_int_equal(mine->width, its->width);
		assert_int_equal(mine->height, its->height);
		assert_int_equal(mine->channels, its->channels);
		assert_memory_equal(mine->hash, its->hash, sizeof mine->hash);
		assert_memory_equal(mine->values, its->values,
				    (size_t)its->width * (size_t)its->height * (size_t)its->channels * sizeof(float));
		assert_memory_equal(mine->bins, its->bins, sizeof mine->bins);
		scene_map_release(mine);
		scene_map_release(its);
	}
	close(fd);
	bytes_finish(&bytes);
}

static void test_finds_what_is_found_here(void **state)
{
	enum { SIDE = 40 };
	static unsigned char rows[SIDE * SIDE * 3];
	static float values[SIDE * SIDE * 3];
	char path[PATH_MAX], error[256];
	(void)state;
	for (size_t i = 0; i < sizeof rows; i++)
		rows[i] = (unsigned char)(i * 13);
	for (size_t i = 0; i < sizeof values / sizeof *values; i++)
		values[i] = (float)i / 4800;
	assert_true(module_path(path));
	const struct image_api *images = image_module_load(path);
	assert_non_null(images);
	decoder = decoder_create(path, &decoder_default_limits);
	compare_with_this_process(images, png_of(SIDE, SIDE, 8, 2, rows), 16);
	compare_with_this_process(images, png_of(SIDE, SIDE, 8, 0, rows), 64);
	compare_with_this_process(images, exr_of(SIDE, SIDE, &(struct exr_options){.channels = "BGR", .type = EXR_FLOAT_TYPE}, values), 64);

	/* A picture that says less than it is: its size is not what was found before. */
	struct asset_facts facts = {.width = 8, .height = 8};
	struct scene_map *map;
	struct file_bytes png = png_of(SIDE, SIDE, 8, 0, rows);
	const int fd = memfd_create("picture", MFD_CLOEXEC);
	assert_int_equal(write(fd, png.data, png.size), png.size);
	assert_int_equal(decoder_read_map(decoder, fd, png.size, INFINITY, &facts, ASSET_THICKNESS, 64, hash, &map, error, sizeof error),
			 DECODER_REFUSED);
	assert_null(map);
	assert_int_equal(decoder_examine(decoder, fd, png.size - 30, INFINITY, &facts, error, sizeof error), DECODER_REFUSED);
	assert_non_null(strstr(error, "ends before its picture does"));
	close(fd);
	bytes_finish(&png);
}

static void test_without_its_module(void **state)
{
	char error[256];
	(void)state;
	decoder = decoder_create("/nowhere.so", &decoder_default_limits);
	assert_int_equal(examine_within(HONEST, LONG_MS, error), DECODER_FAILED);
}

int main(int argc, char **argv)
{
	static const struct image_api misbehaving = {.version = "misbehaving", .decode = misbehave};
	if (argc == 3 && strcmp(argv[1], DECODER_PROCESS_FLAG) == 0) {
		if (*argv[2])
			return decoder_process_main(argv[2]);
		decoder_process_serve(&misbehaving);
		return 0;
	}
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(test_faults_of_libraries, start, stop),
		cmocka_unit_test_setup_teardown(test_time, start_with_little_time, stop),
		cmocka_unit_test_setup_teardown(test_no_way_out, start, stop),
		cmocka_unit_test_setup_teardown(test_deadline, start, stop),
		cmocka_unit_test_setup_teardown(test_process_is_replaced, start, stop),
		cmocka_unit_test_setup_teardown(test_giving_up, start, stop),
		cmocka_unit_test_setup_teardown(test_nothing_is_left, start, stop),
		cmocka_unit_test_setup_teardown(test_from_many_threads, start, stop),
		cmocka_unit_test_teardown(test_finds_what_is_found_here, stop),
		cmocka_unit_test_teardown(test_without_its_module, stop),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
