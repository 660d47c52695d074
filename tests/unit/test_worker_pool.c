/* The pool of workers: bounded, and swept of what is over. */
#include "server/worker_pool.h"

#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmocka.h>

/* Work that ends when it is told to, and says who ran it. */
struct task {
	struct work work;
	_Atomic bool hold, started, done;
	bool over;
	pthread_t runner;
	int nice;
};

static struct task *task_of(struct work *work)
{
	return (struct task *)((char *)work - offsetof(struct task, work));
}

static void run(struct work *work)
{
	struct task *task = task_of(work);
	task->runner = pthread_self();
	task->nice = getpriority(PRIO_PROCESS, (id_t)gettid());
	task->started = true;
	while (task->hold)
		usleep(100);
	task->done = true;
}

static bool is_over(struct work *work)
{
	return task_of(work)->over;
}

static void await(const _Atomic bool *flag)
{
	for (int i = 0; i < 1000000 && !*flag; i++)
		usleep(100);
	assert_true(*flag);
}

static void test_backlog_is_bounded(void **state)
{
	(void)state;
	struct worker_pool *pool = worker_pool_create(1, 2, 0);
	struct task tasks[4] = {{.hold = true}};
	assert_non_null(pool);
	for (int i = 0; i < 4; i++)
		tasks[i].work.run = run;
	assert_true(worker_pool_try(pool, &tasks[0].work));
	await(&tasks[0].started);
	assert_true(worker_pool_try(pool, &tasks[1].work));
	assert_true(worker_pool_try(pool, &tasks[2].work));
	assert_false(worker_pool_try(pool, &tasks[3].work));
	assert_int_equal(worker_pool_waiting(pool), 2);
	tasks[0].hold = false;
	worker_pool_wait(pool, &tasks[3].work);
	worker_pool_destroy(pool);
	for (int i = 0; i < 4; i++)
		assert_true(tasks[i].done);
}

/* Whichever places in the queue are over, they run here and now, and the others in their order. */
static void test_sweep(void **state)
{
	(void)state;
	for (unsigned over = 0; over < 16; over++) {
		struct worker_pool *pool = worker_pool_create(1, 5, 0);
		struct task first = {.work.run = run, .hold = true}, tasks[4] = {{.over = false}}, last = {.work.run = run};
		assert_non_null(pool);
		assert_true(worker_pool_try(pool, &first.work));
		await(&first.started);
		for (unsigned i = 0; i < 4; i++) {
			tasks[i].work = (struct work){.run = run, .is_over = is_over};
			tasks[i].over = over >> i & 1;
			assert_true(worker_pool_try(pool, &tasks[i].work));
		}
		worker_pool_sweep(pool);
		for (unsigned i = 0; i < 4; i++)
			assert_int_equal(tasks[i].done, over >> i & 1);
		assert_int_equal(worker_pool_waiting(pool), 4 - __builtin_popcount(over));
		assert_true(worker_pool_try(pool, &last.work));
		first.hold = false;
		worker_pool_destroy(pool);
		assert_true(last.done);
		for (unsigned i = 0; i < 4; i++) {
			assert_true(tasks[i].done);
			assert_int_equal(pthread_equal(tasks[i].runner, pthread_self()) != 0, over >> i & 1);
		}
	}
}

/* Order of running, noted by the tasks themselves. */
struct noted {
	struct work work;
	int *count, *order, number;
};

static void note(struct work *work)
{
	struct noted *noted = (struct noted *)((char *)work - offsetof(struct noted, work));
	noted->order[(*noted->count)++] = noted->number;
}

/* One that has handed over as much as it may is refused more; another finds a place, and the thread, before the rest of the first. */
static void test_clients_share(void **state)
{
	(void)state;
	enum { BACKLOG = 12, HALF = BACKLOG / 2 };
	struct worker_pool *pool = worker_pool_create(1, BACKLOG, 0);
	struct task first = {.work = {.run = run, .client = "one"}, .hold = true};
	struct noted tasks[BACKLOG];
	char key[] = "another"; /* not needed any longer than the handing over */
	int count = 0, order[BACKLOG];
	assert_non_null(pool);
	for (int i = 0; i < BACKLOG; i++)
		tasks[i] = (struct noted){.work = {.run = note, .client = "one"}, .count = &count, .order = order, .number = i};
	assert_true(worker_pool_try(pool, &first.work));
	await(&first.started);
	for (int i = 0; i < HALF; i++)
		assert_true(worker_pool_try(pool, &tasks[i].work));
	assert_false(worker_pool_try(pool, &tasks[HALF].work));
	assert_int_equal(worker_pool_waiting(pool), HALF);
	tasks[HALF].work.client = tasks[HALF + 1].work.client = key;
	assert_true(worker_pool_try(pool, &tasks[HALF].work));
	assert_true(worker_pool_try(pool, &tasks[HALF + 1].work));
	key[0] = 'x';
	tasks[HALF + 2].work.client = "a third";
	assert_true(worker_pool_try(pool, &tasks[HALF + 2].work));
	assert_int_equal(worker_pool_waiting(pool), HALF + 3);
	usleep(20000); /* which the first pays: more than what the others take */
	first.hold = false;
	worker_pool_destroy(pool);
	assert_int_equal(count, HALF + 3);
	/* What came first of either, whatever that took; then each by itself in its order. */
	assert_true((order[0] == HALF && order[1] == HALF + 2) || (order[0] == HALF + 2 && order[1] == HALF));
	for (int i = 0, next = 0; i < count; i++)
		if (order[i] < HALF)
			assert_int_equal(order[i], next++);
}

static void test_threads_stand_back(void **state)
{
	(void)state;
	struct task task = {.work.run = run};
	int mine = getpriority(PRIO_PROCESS, 0), expected = mine > 7 ? mine : 7;
	struct worker_pool *pool = worker_pool_create(1, 1, expected);
	assert_non_null(pool);
	assert_true(worker_pool_try(pool, &task.work));
	worker_pool_destroy(pool);
	assert_int_equal(task.nice, expected);
	assert_int_equal(getpriority(PRIO_PROCESS, 0), mine);
	worker_pool_destroy(NULL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_backlog_is_bounded),
		cmocka_unit_test(test_sweep),
		cmocka_unit_test(test_clients_share),
		cmocka_unit_test(test_threads_stand_back),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
