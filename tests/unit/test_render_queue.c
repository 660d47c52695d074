/* The queue of renders: its limits, its order, and many threads at once. */
#include "server/render_queue.h"

#include "server/clock.h"

#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { CLIENTS = 6, EACH = 300 };

struct picture {
	struct render_job job;
	struct scene scene;
	char client[16];
	_Atomic bool gone;
	_Atomic int ends;
};

static bool is_gone(struct render_job *job)
{
	return ((struct picture *)job)->gone;
}

static void count_end(struct render_job *job)
{
	((struct picture *)job)->ends++;
}

static void init(struct picture *picture, int client, int width, int height)
{
	picture->gone = false;
	picture->ends = 0;
	picture->scene = scene_default();
	picture->scene.output.width = width;
	picture->scene.output.height = height;
	snprintf(picture->client, sizeof picture->client, "client %d", client);
	picture->job = (struct render_job){.scene = &picture->scene,
					   .client = picture->client,
					   .predicted_ms = 1e-4 * width * height,
					   .deadline_ms = clock_now_ms() + 60000,
					   .abandoned = is_gone,
					   .finished = count_end};
}

static struct picture *serve(struct render_queue *queue)
{
	struct render_job *job = render_queue_pop(queue);
	if (job)
		render_queue_settle(queue, job, job->predicted_ms);
	return (struct picture *)job;
}

static void limits(void **state)
{
	(void)state;
	struct render_queue *queue = render_queue_create(&(struct render_queue_limits){3, 2.5e6});
	struct picture pictures[6];
	for (int i = 0; i < 6; i++)
		init(&pictures[i], i, 1000, 1000);
	assert_true(render_queue_push(queue, &pictures[0].job));
	assert_true(render_queue_push(queue, &pictures[1].job));
	assert_false(render_queue_push(queue, &pictures[2].job));
	assert_int_equal(pictures[2].job.refusal, RENDER_REFUSED_PIXELS);
	init(&pictures[3], 3, 16, 16);
	assert_true(render_queue_push(queue, &pictures[3].job));
	init(&pictures[4], 4, 16, 16);
	assert_false(render_queue_push(queue, &pictures[4].job));
	assert_int_equal(pictures[4].job.refusal, RENDER_REFUSED_COUNT);
	assert_int_equal(render_queue_depth(queue), 3);
	assert_float_equal(render_queue_pixels(queue), 2e6 + 256, 1e-6);
	assert_float_equal(render_queue_backlog_ms(queue), 201, 1.1);
	/* What was admitted elsewhere comes in; what leaves makes room. */
	render_queue_pass(queue, &pictures[2].job);
	for (int i = 0; i < 4; i++)
		assert_non_null(serve(queue));
	assert_float_equal(render_queue_backlog_ms(queue), 0, 1e-9);
	assert_float_equal(render_queue_pixels(queue), 0, 1e-9);
	/* Alone a picture may be larger than all that may wait. */
	init(&pictures[5], 5, 4000, 2000);
	assert_true(render_queue_push(queue, &pictures[5].job));
	render_queue_close(queue);
	assert_false(render_queue_push(queue, &pictures[0].job));
	assert_int_equal(pictures[0].job.refusal, RENDER_REFUSED_CLOSED);
	assert_ptr_equal(serve(queue), &pictures[5]);
	assert_null(serve(queue));
	render_queue_destroy(queue);
}

static void previews_pass_a_batch(void **state)
{
	(void)state;
	struct render_queue *queue = render_queue_create(&(struct render_queue_limits){100, 1e9});
	static struct picture batch[50], preview;
	for (int i = 0; i < 50; i++) {
		init(&batch[i], 0, 3840, 2160);
		assert_true(render_queue_push(queue, &batch[i].job));
	}
	struct render_job *running = render_queue_pop(queue);
	init(&preview, 1, 320, 240);
	assert_true(render_queue_ahead_ms(queue, preview.client, preview.job.predicted_ms) <= running->predicted_ms);
	assert_true(render_queue_ahead_ms(queue, batch[0].client, running->predicted_ms) > 45 * running->predicted_ms);
	assert_true(render_queue_push(queue, &preview.job));
	render_queue_settle(queue, running, running->predicted_ms);
	assert_ptr_equal(serve(queue), &preview);
	while (render_queue_depth(queue))
		serve(queue);
	render_queue_destroy(queue);
}

/* What two clients wait for is served in the line where that is sooner, whoever of them is still there; and how soon is known before. */
static void joined_jobs_change_lines(void **state)
{
	(void)state;
	struct render_queue *queue = render_queue_create(&(struct render_queue_limits){100, 1e9});
	static struct picture batch[10];
	double ahead_ms, own_ms;
	for (int i = 0; i < 10; i++) {
		init(&batch[i], 0, 3840, 2160);
		batch[i].job.flight = (unsigned long)i + 1;
		assert_true(render_queue_push(queue, &batch[i].job));
	}
	const double each_ms = batch[0].job.predicted_ms, backlog_ms = render_queue_backlog_ms(queue);
	struct render_job *running = render_queue_pop(queue);
	assert_false(render_queue_foresee(queue, 11, "client 0", &ahead_ms, &own_ms));
	assert_true(render_queue_foresee(queue, running->flight, "client 0", &ahead_ms, &own_ms));
	assert_float_equal(ahead_ms, 0, 1e-9);
	assert_true(own_ms > 0.5 * each_ms && own_ms <= each_ms);
	assert_true(render_queue_foresee(queue, 10, "client 0", &ahead_ms, &own_ms));
	assert_true(ahead_ms > 8 * each_ms && ahead_ms <= 9 * each_ms);
	assert_true(render_queue_foresee(queue, 10, "client 1", &ahead_ms, &own_ms));
	assert_true(ahead_ms <= each_ms);
	assert_float_equal(own_ms, each_ms, 1e-9);
	char joiner[] = "client 1";
	render_queue_share(queue, 11, joiner); /* nobody's */
	render_queue_share(queue, 10, joiner);
	memset(joiner, 'x', sizeof joiner - 1); /* has left */
	assert_true(fabs(render_queue_backlog_ms(queue) - backlog_ms) < each_ms);
	render_queue_settle(queue, running, each_ms);
	struct render_job *joined = render_queue_pop(queue);
	assert_ptr_equal(joined, &batch[9].job);
	assert_string_equal(joined->client, "client 1");
	render_queue_settle(queue, joined, 1);
	render_queue_pass(queue, joined); /* its next turn is that client's as well */
	assert_true(render_queue_foresee(queue, 10, "client 0", &ahead_ms, &own_ms));
	assert_true(ahead_ms <= each_ms);
	int served = 0;
	while (render_queue_depth(queue))
		served += serve(queue) != NULL;
	assert_int_equal(served, 9);
	render_queue_destroy(queue);
}

static bool has_gone(struct render_job *job, void *context)
{
	(void)context;
	return render_job_is_over(job);
}

static void who_has_gone_makes_room(void **state)
{
	(void)state;
	struct render_queue *queue = render_queue_create(&(struct render_queue_limits){2, 1e9});
	struct picture pictures[3];
	for (int i = 0; i < 3; i++)
		init(&pictures[i], i, 100, 100);
	assert_true(render_queue_push(queue, &pictures[0].job));
	assert_true(render_queue_push(queue, &pictures[1].job));
	assert_null(render_queue_remove(queue, has_gone, NULL));
	pictures[0].gone = true;
	assert_ptr_equal(render_queue_remove(queue, has_gone, NULL), &pictures[0].job);
	assert_int_equal(pictures[0].job.outcome, RENDER_OUTCOME_ABANDONED);
	assert_int_equal(render_queue_depth(queue), 1);
	assert_true(render_queue_push(queue, &pictures[2].job));
	pictures[2].job.deadline_ms = 0;
	assert_ptr_equal(render_queue_remove(queue, has_gone, NULL), &pictures[2].job);
	assert_int_equal(pictures[2].job.outcome, RENDER_OUTCOME_EXPIRED);
	assert_ptr_equal(serve(queue), &pictures[1]);
	render_queue_destroy(queue);
}

/* --- many threads ----------------------------------------------------------------------------------------------------------------- */

struct crowd {
	struct render_queue *queue;
	struct picture pictures[CLIENTS][EACH];
	_Atomic int refused;
	_Atomic bool done;
};

struct pusher {
	struct crowd *crowd;
	int client;
	pthread_t thread;
};

static void waiting_ends(void **state)
{
	(void)state;
	struct render_queue *queue = render_queue_create(&(struct render_queue_limits){3, 1e9});
	struct picture picture;
	bool closed = true;
	const double begin_ms = clock_now_ms();
	assert_null(render_queue_pop_within(queue, 30, &closed));
	assert_false(closed);
	assert_true(clock_now_ms() - begin_ms >= 29);
	init(&picture, 0, 16, 16);
	assert_true(render_queue_push(queue, &picture.job));
	render_queue_close(queue);
	assert_ptr_equal(render_queue_pop_within(queue, 60000, &closed), &picture.job);
	assert_false(closed);
	render_queue_settle(queue, &picture.job, 1);
	assert_null(render_queue_pop_within(queue, 60000, &closed));
	assert_true(closed);
	render_queue_destroy(queue);
}

static void *push_all(void *context)
{
	const struct pusher *pusher = context;
	for (int i = 0; i < EACH; i++) {
		struct picture *picture = &pusher->crowd->pictures[pusher->client][i];
		init(picture, pusher->client, 16 + 16 * (i % 30), 64);
		/* It may be served, and end, before this returns. */
		if (render_queue_push(pusher->crowd->queue, &picture->job)) {
			picture->gone = i % 5 == 0;
		} else {
			atomic_fetch_add(&pusher->crowd->refused, 1);
			atomic_fetch_add(&picture->ends, 1);
		}
		if (i % 20 == 0)
			usleep(200);
	}
	return NULL;
}

static void *serve_all(void *context)
{
	struct crowd *crowd = context;
	for (struct render_job *job; (job = render_queue_pop(crowd->queue));) {
		render_queue_settle(crowd->queue, job, 0.5 * job->predicted_ms);
		job->finished(job);
	}
	return NULL;
}

static void *drop_all(void *context)
{
	struct crowd *crowd = context;
	while (!crowd->done) {
		for (struct render_job *job; (job = render_queue_remove(crowd->queue, has_gone, NULL));)
			job->finished(job);
		assert_true(render_queue_ahead_ms(crowd->queue, "client 1", 1) >= 0);
		assert_true(render_queue_backlog_ms(crowd->queue) >= 0);
		usleep(100);
	}
	return NULL;
}

/* Every job ends once: refused, served or dropped. */
static void many_threads(void **state)
{
	(void)state;
	static struct crowd crowd;
	crowd.queue = render_queue_create(&(struct render_queue_limits){40, 1e9});
	struct pusher pushers[CLIENTS];
	pthread_t server, dropper;
	assert_int_equal(pthread_create(&server, NULL, serve_all, &crowd), 0);
	assert_int_equal(pthread_create(&dropper, NULL, drop_all, &crowd), 0);
	for (int i = 0; i < CLIENTS; i++) {
		pushers[i] = (struct pusher){.crowd = &crowd, .client = i};
		assert_int_equal(pthread_create(&pushers[i].thread, NULL, push_all, &pushers[i]), 0);
	}
	for (int i = 0; i < CLIENTS; i++)
		pthread_join(pushers[i].thread, NULL);
	crowd.done = true;
	pthread_join(dropper, NULL);
	render_queue_close(crowd.queue);
	pthread_join(server, NULL);
	assert_int_equal(render_queue_depth(crowd.queue), 0);
	for (int i = 0; i < CLIENTS; i++)
		for (int j = 0; j < EACH; j++)
			assert_int_equal(crowd.pictures[i][j].ends, 1);
	assert_true(crowd.refused < CLIENTS * EACH);
	render_queue_destroy(crowd.queue);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(limits),
		cmocka_unit_test(previews_pass_a_batch),
		cmocka_unit_test(who_has_gone_makes_room),
		cmocka_unit_test(joined_jobs_change_lines),
		cmocka_unit_test(waiting_ends),
		cmocka_unit_test(many_threads),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
