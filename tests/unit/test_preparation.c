/* The line of jobs that wait for their droplets, without a renderer: who goes on when, and how much is held. */
#include "test_droplets_common.h"

#include "server/clock.h"
#include "server/preparation.h"

#include <stdatomic.h>

enum { JOBS = 6 };

struct waiter {
	struct render_job job;
	struct scene scene;
	bool left;
	_Atomic bool ended;
};

struct fixture {
	struct droplet_store *store;
	struct render_queue *queue;
	struct preparation *preparation;
	struct waiter waiters[JOBS];
};

static bool has_left(struct render_job *job)
{
	return ((struct waiter *)job)->left;
}

static void end(struct render_job *job)
{
	((struct waiter *)job)->ended = true;
}

/* Room in memory for so many tables; queue and line of `limit` each. */
static struct fixture *start(double tables, size_t limit)
{
	struct fixture *fixture = calloc(1, sizeof *fixture);
	assert_non_null(fixture);
	fixture->store = droplet_store_create(&(struct droplet_store_params){
		.kernel = kernel, .memory_bytes = (size_t)(tables * (double)sizeof(struct droplet_storage)), .threads = 2});
	const struct render_queue_limits limits = {limit, 1e9};
	fixture->queue = render_queue_create(&limits);
	fixture->preparation = preparation_create(fixture->store, fixture->queue, &limits);
	assert_non_null(fixture->preparation);
	for (int i = 0; i < JOBS; i++) {
		struct waiter *waiter = &fixture->waiters[i];
		waiter->scene = scene_default();
		waiter->scene.dsd = (struct scene_dsd){100 + i, 12, 6};
		waiter->scene.model.shading = SHADING_SOLVED;
		waiter->job = (struct render_job){
			.scene = &waiter->scene, .deadline_ms = clock_now_ms() + 600000, .abandoned = has_left, .finished = end};
	}
	return fixture;
}

static void finish(struct fixture *fixture)
{
	preparation_destroy(fixture->preparation);
	render_queue_destroy(fixture->queue);
	droplet_store_destroy(fixture->store);
	free(fixture);
}

static bool push(struct fixture *fixture, int i)
{
	return preparation_push(fixture->preparation, &fixture->waiters[i].job);
}

/* As the render thread does; returns which it was. */
static int render_next(struct fixture *fixture)
{
	struct render_job *job = render_queue_pop(fixture->queue);
	render_queue_settle(fixture->queue, job, 1);
	assert_non_null(job);
	assert_non_null(job->droplets);
	assert_true(job->droplets->optics->extinction_per_m[0] > 0);
	preparation_release(fixture->preparation, job);
	preparation_release(fixture->preparation, job);
	return (int)((struct waiter *)job - fixture->waiters);
}

static void await_depth(struct fixture *fixture, size_t waiting, size_t prepared)
{
	double limit = clock_now_ms() + 180000;
	while (preparation_depth(fixture->preparation) != waiting || render_queue_depth(fixture->queue) != prepared) {
		assert_true(clock_now_ms() < limit);
		usleep(1000);
	}
}

static void prepared_in_turn(void **state)
{
	(void)state;
	struct fixture *fixture = start(8, JOBS);
	for (int i = 0; i < 3; i++)
		assert_true(push(fixture, i));
	for (int i = 0; i < 3; i++)
		assert_int_equal(render_next(fixture), i);
	for (int i = 0; i < 3; i++) {
		assert_true(fixture->waiters[i].job.prepared);
		assert_true(fixture->waiters[i].job.prepared_ms > 1);
		assert_false(fixture->waiters[i].ended);
	}
	assert_true(fixture->waiters[2].job.waited_ms > fixture->waiters[0].job.waited_ms);
	assert_true(preparation_typical_ms(fixture->preparation) > 1);
	assert_true(preparation_busy_ms(fixture->preparation) == 0);

	/* Known now: queued by the call itself. */
	fixture->waiters[1].job.prepared = false;
	fixture->waiters[1].job.prepared_ms = 0;
	assert_true(push(fixture, 1));
	assert_int_equal(render_queue_depth(fixture->queue), 1);
	assert_int_equal(render_next(fixture), 1);
	assert_false(fixture->waiters[1].job.prepared);
	assert_true(fixture->waiters[1].job.prepared_ms == 0);
	finish(fixture);
}

/* All five are to be in line before the first is done, which a busy machine may prevent. */
static bool went_on_together(void)
{
	struct fixture *fixture = start(8, JOBS);
	fixture->waiters[4].scene.dsd = fixture->waiters[0].scene.dsd;
	for (int i = 0; i < 5; i++)
		assert_true(push(fixture, i));
	await_depth(fixture, 0, 5);
	int order[5];
	for (int i = 0; i < 5; i++)
		order[i] = render_next(fixture);
	assert_int_equal(droplet_store_counts(fixture->store).from[DROPLETS_COMPUTED], 4);
	finish(fixture);
	const int expected[] = {0, 4, 1, 2, 3};
	return memcmp(order, expected, sizeof order) == 0;
}

static void same_droplets_go_on_together(void **state)
{
	(void)state;
	bool together = false;
	for (int i = 0; i < 6 && !together; i++)
		together = went_on_together();
	assert_true(together);
}

static void full_line(void **state)
{
	(void)state;
	struct fixture *fixture = start(8, 1);
	int taken = 0;
	for (int i = 0; i < JOBS; i++)
		taken += push(fixture, i);
	assert_true(taken >= 1 && taken < JOBS);
	await_depth(fixture, 0, (size_t)taken); /* what was taken is passed on, whatever the queue's limit */
	for (int i = 0; i < taken; i++)
		render_next(fixture);
	fixture->waiters[1].scene.dsd = fixture->waiters[0].scene.dsd; /* known */
	assert_true(push(fixture, 0));
	assert_false(push(fixture, 1));
	assert_null(fixture->waiters[1].job.droplets);
	render_next(fixture);
	finish(fixture);
}

/* Where nothing is prepared, since the thread waits for room: one client has half of the line, another's job is prepared next. */
static void clients_share_the_line(void **state)
{
	(void)state;
	struct fixture *fixture = start(1.5, 4);
	for (int i = 0; i < JOBS; i++)
		fixture->waiters[i].job.client = i < 4 ? "one" : "another";
	assert_true(push(fixture, 0));
	await_depth(fixture, 0, 1);
	assert_true(push(fixture, 1));
	await_depth(fixture, 0, 1); /* in work, waiting for room */
	assert_true(push(fixture, 2));
	assert_true(push(fixture, 3));
	fixture->waiters[5].job.client = "one";
	assert_false(push(fixture, 5));
	assert_int_equal(fixture->waiters[5].job.refusal, RENDER_REFUSED_COUNT);
	assert_int_equal(preparation_depth_before(fixture->preparation, "another"), 0);
	assert_int_equal(preparation_depth_before(fixture->preparation, "one"), 2);
	assert_true(push(fixture, 4));
	assert_int_equal(preparation_depth_before(fixture->preparation, "one"), 3);
	await_depth(fixture, 3, 1);
	const int order[] = {0, 1, 4, 2, 3};
	for (int i = 0; i < 5; i++)
		assert_int_equal(render_next(fixture), order[i]);
	/* Their places are free again. */
	assert_int_equal(preparation_depth_before(fixture->preparation, "one"), 0);
	assert_true(push(fixture, 5));
	assert_int_equal(render_next(fixture), 5);
	finish(fixture);
}

static void dropped_jobs_leave_their_places(void **state)
{
	(void)state;
	struct fixture *fixture = start(1.5, 4);
	for (int i = 0; i < JOBS; i++)
		fixture->waiters[i].job.client = "one";
	assert_true(push(fixture, 0));
	await_depth(fixture, 0, 1);
	assert_true(push(fixture, 1));
	await_depth(fixture, 0, 1);
	for (int i = 2; i < 4; i++) {
		assert_true(push(fixture, i));
		fixture->waiters[i].left = true;
	}
	assert_false(push(fixture, 4));
	preparation_drop_over(fixture->preparation);
	assert_true(fixture->waiters[2].ended && fixture->waiters[3].ended);
	assert_int_equal(preparation_depth_before(fixture->preparation, "one"), 0);
	assert_true(push(fixture, 4));
	assert_true(push(fixture, 5));
	const int order[] = {0, 1, 4, 5};
	for (int i = 0; i < 4; i++)
		assert_int_equal(render_next(fixture), order[i]);
	finish(fixture);
}

/* Nobody renders: no more is prepared than may be held. */
static void as_much_is_held_as_may_be(void **state)
{
	(void)state;
	struct fixture *fixture = start(2.5, JOBS);
	for (int i = 0; i < JOBS; i++)
		assert_true(push(fixture, i));
	await_depth(fixture, JOBS - 3, 2); /* the third is in work, waiting for room */
	usleep(100000);
	await_depth(fixture, JOBS - 3, 2);
	assert_int_equal(droplet_store_counts(fixture->store).memory_bytes, 2 * sizeof(struct droplet_storage));
	for (int i = 0; i < JOBS; i++)
		assert_int_equal(render_next(fixture), i);
	assert_true(droplet_store_counts(fixture->store).memory_bytes <= 2 * sizeof(struct droplet_storage));
	finish(fixture);
}

/* What others hold for ever, the renderer's own memory for instance, is not waited for. */
static void others_may_hold_all(void **state)
{
	(void)state;
	struct fixture *fixture = start(1.5, JOBS);
	const struct scene_dsd dsd = {100, 3, 5};
	const struct droplet_tables *held = droplet_store_get(fixture->store, &dsd, OPTICS_MIE, NULL);
	assert_non_null(held);
	for (int i = 0; i < 3; i++)
		assert_true(push(fixture, i));
	for (int i = 0; i < 3; i++)
		assert_int_equal(render_next(fixture), i);
	droplet_store_release(fixture->store, held);
	finish(fixture);
}

static void jobs_that_are_over(void **state)
{
	(void)state;
	struct fixture *fixture = start(1.5, JOBS);
	assert_true(push(fixture, 0));
	await_depth(fixture, 0, 1);
	fixture->waiters[1].job.deadline_ms = clock_now_ms() + 50; /* ends while it waits for room */
	fixture->waiters[2].left = true;
	fixture->waiters[3].job.deadline_ms = 0;
	for (int i = 1; i < 5; i++)
		assert_true(push(fixture, i));
	await_depth(fixture, 0, 1);
	assert_int_equal(render_next(fixture), 0);
	assert_int_equal(render_next(fixture), 4);
	for (int i = 1; i < 4; i++) {
		assert_true(fixture->waiters[i].ended);
		assert_int_equal(fixture->waiters[i].job.outcome, i == 2 ? RENDER_OUTCOME_ABANDONED : RENDER_OUTCOME_EXPIRED);
		assert_null(fixture->waiters[i].job.droplets);
	}
	assert_int_equal(droplet_store_counts(fixture->store).from[DROPLETS_COMPUTED], 2);
	finish(fixture);
}

static void finish_with_bad_droplets(void *context)
{
	struct fixture *fixture = context;
	assert_true(push(fixture, 0));
	preparation_destroy(fixture->preparation); /* ends what it took on */
	fixture->preparation = NULL;
}

static void droplets_that_cannot_be_had(void **state)
{
	(void)state;
	struct fixture *fixture = start(2, JOBS);
	fixture->waiters[0].scene.dsd.gamma = NAN;
	free(log_of(finish_with_bad_droplets, fixture));
	assert_true(fixture->waiters[0].ended);
	assert_int_equal(fixture->waiters[0].job.outcome, RENDER_OUTCOME_FAILED);
	finish(fixture);
}

/* The paper's shading needs its fit too. */
static void fits_are_prepared(void **state)
{
	(void)state;
	struct fixture *fixture = start(8, JOBS);
	const struct scene *scene = &fixture->waiters[0].scene;
	assert_true(push(fixture, 0));
	render_next(fixture);
	assert_false(droplet_store_has(fixture->store, &scene->dsd, OPTICS_MIE, true));
	fixture->waiters[1].scene = *scene;
	fixture->waiters[1].scene.model.shading = SHADING_PAPER;
	assert_true(push(fixture, 1));
	render_next(fixture);
	assert_true(fixture->waiters[1].job.prepared);
	assert_true(droplet_store_has(fixture->store, &scene->dsd, OPTICS_MIE, true));
	finish(fixture);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(prepared_in_turn),
		cmocka_unit_test(same_droplets_go_on_together),
		cmocka_unit_test(full_line),
		cmocka_unit_test(clients_share_the_line),
		cmocka_unit_test(dropped_jobs_leave_their_places),
		cmocka_unit_test(as_much_is_held_as_may_be),
		cmocka_unit_test(others_may_hold_all),
		cmocka_unit_test(jobs_that_are_over),
		cmocka_unit_test(droplets_that_cannot_be_had),
		cmocka_unit_test(fits_are_prepared),
	};
	int status = load_kernel();
	if (status == 0)
		status = cmocka_run_group_tests(tests, NULL, NULL);
	kernel_destroy(kernel);
	return status;
}
