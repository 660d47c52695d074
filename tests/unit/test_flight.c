/* One render for several who wait: each with its own deadline and client, the work dropped when nobody is left. */
#include "server/clock.h"
#include "server/flight.h"

#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

/* Who waits. */
struct guest {
	struct flight_seat seat;
	_Atomic bool gone;
	_Atomic int left; /* times */
};

static bool is_gone(struct flight_seat *seat)
{
	return ((struct guest *)seat)->gone;
}

static void leave(struct flight_seat *seat)
{
	((struct guest *)seat)->left++;
}

static struct guest guest_until(double deadline_ms)
{
	return (struct guest){.seat = {.deadline_ms = deadline_ms, .is_gone = is_gone, .leave = leave}};
}

static struct finished_image *image_of(const char *tag)
{
	return finished_image_create(tag, calloc(1, 100), 100, 1, 0);
}

struct fixture {
	struct image_cache *cache;
	struct flights *flights;
	struct flight flight, other;
	_Atomic double deadline_ms, other_deadline_ms;
};

static void set_up(struct fixture *fixture)
{
	*fixture = (struct fixture){.cache = image_cache_create(100000)};
	fixture->flights = flights_create(fixture->cache);
	assert_non_null(fixture->flights);
}

static void tear_down(struct fixture *fixture)
{
	assert_int_equal(flights_open(fixture->flights), 0);
	flights_destroy(fixture->flights);
	image_cache_destroy(fixture->cache);
}

static enum flight_boarding board(struct fixture *fixture, const char *tag, struct guest *guest)
{
	return flight_board(fixture->flights, tag, &fixture->flight, &fixture->deadline_ms, &guest->seat);
}

/* For whom `flight` is not to be touched. */
static enum flight_boarding board_other(struct fixture *fixture, const char *tag, struct guest *guest)
{
	return flight_board(fixture->flights, tag, &fixture->other, &fixture->other_deadline_ms, &guest->seat);
}

static void test_all_get_the_image(void **state)
{
	(void)state;
	struct fixture f;
	const double now = clock_now_ms();
	struct guest a = guest_until(now + 1e5), b = guest_until(now + 2e5), c = guest_until(now + 1e5);
	set_up(&f);
	assert_int_equal(flights_find(f.flights, "\"1\""), 0);
	assert_int_equal(board(&f, "\"1\"", &a), FLIGHT_OPENED);
	assert_int_equal(board_other(&f, "\"1\"", &b), FLIGHT_JOINED);
	assert_int_equal(board_other(&f, "\"2\"", &c), FLIGHT_OPENED);
	assert_true(f.flight.number != 0 && f.other.number != 0 && f.flight.number != f.other.number);
	assert_true(a.seat.flight == f.flight.number && b.seat.flight == f.flight.number && c.seat.flight == f.other.number);
	assert_true(flights_find(f.flights, "\"1\"") == f.flight.number && flights_find(f.flights, "\"2\"") == f.other.number);
	assert_true(f.deadline_ms == now + 2e5); /* of the later */
	assert_true(flight_is_wanted(&f.flight));
	struct finished_image *image = image_of("\"1\"");
	flight_arrive(&f.flight, RENDER_OUTCOME_OK, image);
	flights_close(f.flights);
	assert_int_equal(image->holders, 3);
	assert_true(a.left == 1 && b.left == 1 && c.left == 0);
	assert_true(a.seat.image == image && b.seat.image == image);
	assert_true(!a.seat.has_joined && b.seat.has_joined && a.seat.has_arrived);
	finished_image_release(a.seat.image);
	finished_image_release(b.seat.image);
	finished_image_release(image);
	flight_arrive(&f.other, RENDER_OUTCOME_NO_MEMORY, NULL);
	flights_close(f.flights);
	assert_int_equal(c.seat.outcome, RENDER_OUTCOME_NO_MEMORY);
	assert_null(c.seat.image);
	tear_down(&f);
}

static void test_each_leaves_by_itself(void **state)
{
	(void)state;
	struct fixture f;
	const double now = clock_now_ms();
	struct guest late = guest_until(now), goes = guest_until(now + 1e5), stays = guest_until(now + 1e5), after = guest_until(now + 1e5);
	set_up(&f);
	assert_int_equal(board(&f, "\"1\"", &late), FLIGHT_OPENED);
	assert_int_equal(board_other(&f, "\"1\"", &goes), FLIGHT_JOINED);
	assert_int_equal(board_other(&f, "\"1\"", &stays), FLIGHT_JOINED);
	assert_true(flight_is_wanted(&f.flight));
	assert_true(late.left == 1 && goes.left == 0 && stays.left == 0);
	assert_int_equal(late.seat.outcome, RENDER_OUTCOME_EXPIRED);
	goes.gone = true;
	assert_true(flight_is_wanted(&f.flight));
	assert_true(goes.left == 1 && stays.left == 0);
	assert_int_equal(goes.seat.outcome, RENDER_OUTCOME_ABANDONED);
	stays.gone = true;
	assert_false(flight_is_wanted(&f.flight));
	assert_false(flight_is_wanted(&f.flight));
	assert_true(late.left == 1 && goes.left == 1 && stays.left == 1);
	/* What nobody waits for is being dropped: who comes now opens anew. */
	assert_int_equal(board_other(&f, "\"1\"", &after), FLIGHT_OPENED);
	flight_arrive(&f.flight, RENDER_OUTCOME_ABANDONED, NULL);
	flights_close(f.flights);
	assert_int_equal(after.left, 0);
	flight_refuse(&f.other);
	flights_close(f.flights);
	assert_true(after.left == 1 && after.seat.refused);
	tear_down(&f);
}

static void test_late_at_the_end(void **state)
{
	(void)state;
	struct fixture f;
	const double now = clock_now_ms();
	struct guest late = guest_until(now), early = guest_until(now + 1e5), partial = guest_until(now);
	set_up(&f);
	board(&f, "\"1\"", &late);
	board_other(&f, "\"1\"", &early);
	struct finished_image *image = image_of("\"1\"");
	flight_arrive(&f.flight, RENDER_OUTCOME_OK, image);
	flights_close(f.flights);
	assert_int_equal(late.seat.outcome, RENDER_OUTCOME_EXPIRED);
	assert_null(late.seat.image);
	assert_int_equal(early.seat.outcome, RENDER_OUTCOME_OK);
	assert_true(early.seat.image == image);
	f.flight = (struct flight){0};
	assert_int_equal(board(&f, NULL, &partial), FLIGHT_OPENED);
	flight_waive_deadlines(&f.flight);
	flight_arrive(&f.flight, RENDER_OUTCOME_OK, image);
	flights_close(f.flights);
	assert_true(partial.seat.image == image);
	for (int i = 0; i < 3; i++)
		finished_image_release(image);
	tear_down(&f);
}

static void test_alone(void **state)
{
	(void)state;
	struct fixture f;
	struct guest a = guest_until(INFINITY), b = guest_until(INFINITY);
	set_up(&f);
	assert_int_equal(board(&f, NULL, &a), FLIGHT_OPENED);
	assert_int_equal(board_other(&f, NULL, &b), FLIGHT_OPENED);
	flight_refuse(&f.flight);
	flight_refuse(&f.other);
	flights_close(f.flights);
	flights_close(f.flights);
	tear_down(&f);
}

static void test_just_finished(void **state)
{
	(void)state;
	struct fixture f;
	struct guest a = guest_until(INFINITY);
	set_up(&f);
	struct finished_image *image = image_of("\"1\"");
	assert_true(image_cache_keep(f.cache, image));
	assert_int_equal(board(&f, "\"1\"", &a), FLIGHT_ARRIVED);
	assert_true(a.seat.image == image && a.left == 0);
	finished_image_release(a.seat.image);
	finished_image_release(image);
	tear_down(&f);
}

/* Askers and the one who renders, at once: every wait ends exactly once, and an image that is kept is rendered once. */
enum { ASKERS = 4, ROUNDS = 3000, TAGS = 5 };

struct table {
	struct image_cache *cache;
	struct flights *flights;
	struct render_queue *queue;
	_Atomic int rendered, waits, images, gone;
};

struct ask {
	struct guest guest;
	struct flight flight;
	struct render_job job;
	_Atomic int holders;
	char tag[8];
};

static const struct scene scene_of_all = {.output = {.width = 1, .height = 1, .format = IMAGE_PNG}};

static void release(struct ask *ask)
{
	if (--ask->holders == 0)
		free(ask);
}

static bool job_is_abandoned(struct render_job *job)
{
	return !flight_is_wanted(&((struct ask *)((char *)job - offsetof(struct ask, job)))->flight);
}

static void *render_all(void *argument)
{
	struct table *table = argument;
	for (struct render_job *job; (job = render_queue_pop(table->queue));) {
		struct ask *ask = (struct ask *)((char *)job - offsetof(struct ask, job));
		struct finished_image *image = NULL;
		if (!render_job_is_over(job)) {
			table->rendered++;
			image = image_of(ask->tag);
			image_cache_keep(table->cache, image);
			job->outcome = RENDER_OUTCOME_OK;
		}
		flight_arrive(&ask->flight, job->outcome, image);
		finished_image_release(image);
		release(ask);
		flights_close(table->flights);
	}
	return NULL;
}

static void ask_once(struct table *table, unsigned random)
{
	struct ask *ask = calloc(1, sizeof *ask);
	ask->holders = 1;
	ask->guest = guest_until(random % 7 == 0 ? 0 : INFINITY);
	ask->guest.gone = random % 11 == 0;
	ask->tag[0] = (char)('a' + random % TAGS);
	ask->job.scene = &scene_of_all;
	ask->job.abandoned = job_is_abandoned;
	const enum flight_boarding boarding = flight_board(table->flights, ask->tag, &ask->flight, &ask->job.deadline_ms, &ask->guest.seat);
	if (boarding == FLIGHT_OPENED) {
		ask->holders++;
		if (!render_queue_push(table->queue, &ask->job)) {
			flight_refuse(&ask->flight);
			release(ask);
			flights_close(table->flights);
		}
	}
	while (boarding != FLIGHT_ARRIVED && !ask->guest.left)
		usleep(10);
	table->waits += boarding != FLIGHT_ARRIVED;
	const struct flight_seat *seat = &ask->guest.seat;
	if (seat->image) {
		assert_string_equal(seat->image->tag, ask->tag);
		table->images++;
	} else {
		assert_true(seat->refused || seat->outcome != RENDER_OUTCOME_OK);
	}
	finished_image_release(seat->image);
	release(ask);
}

static void *ask_many(void *argument)
{
	unsigned random = (unsigned)(uintptr_t)pthread_self() | 1;
	for (int i = 0; i < ROUNDS; i++) {
		random = random * 1664525 + 1013904223;
		ask_once(argument, random >> 8);
	}
	return NULL;
}

static void run_all(size_t cache_bytes, struct table *table)
{
	pthread_t askers[ASKERS], renderer;
	*table = (struct table){.cache = image_cache_create(cache_bytes),
				.queue = render_queue_create(&(struct render_queue_limits){.jobs = 2, .pixels = 1e9})};
	table->flights = flights_create(table->cache);
	assert_int_equal(pthread_create(&renderer, NULL, render_all, table), 0);
	for (int i = 0; i < ASKERS; i++)
		assert_int_equal(pthread_create(&askers[i], NULL, ask_many, table), 0);
	for (int i = 0; i < ASKERS; i++)
		pthread_join(askers[i], NULL);
	render_queue_close(table->queue);
	pthread_join(renderer, NULL);
	assert_int_equal(flights_open(table->flights), 0);
	flights_destroy(table->flights);
	render_queue_destroy(table->queue);
	image_cache_destroy(table->cache);
}

static void test_many_threads(void **state)
{
	(void)state;
	struct table table;
	run_all(100000, &table);
	assert_int_equal(table.rendered, TAGS);
	assert_true(table.images > ROUNDS);
	run_all(0, &table);
	assert_true(table.rendered > TAGS && table.waits == ASKERS * ROUNDS);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_all_get_the_image), cmocka_unit_test(test_each_leaves_by_itself),
		cmocka_unit_test(test_late_at_the_end),   cmocka_unit_test(test_alone),
		cmocka_unit_test(test_just_finished),     cmocka_unit_test(test_many_threads),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
