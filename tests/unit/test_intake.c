/* How much is taken on: places, and what a simulated overload makes of them. */
#include "server/fair_order.h"
#include "server/intake.h"

#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* --- places ----------------------------------------------------------------------------------------------------------------------- */

static void as_many_as_there_are(void **state)
{
	(void)state;
	struct intake *intake = intake_create(3);
	struct intake_place places[4] = {0};
	double late_ms;
	for (int i = 0; i < 3; i++)
		assert_int_equal(intake_enter(intake, &places[i], 1e9, i, &late_ms), INTAKE_TAKEN);
	assert_int_equal(intake_enter(intake, &places[3], 0, 3, &late_ms), INTAKE_FULL);
	assert_false(places[3].is_taken);
	intake_leave(intake, &places[3], true, 4); /* none to give back */
	assert_int_equal(intake_look(intake).taken, 3);
	intake_leave(intake, &places[1], false, 5);
	intake_leave(intake, &places[1], false, 6); /* once */
	assert_int_equal(intake_look(intake).taken, 2);
	assert_int_equal(intake_enter(intake, &places[3], 0, 7, &late_ms), INTAKE_TAKEN);
	for (int i = 0; i < 4; i++)
		intake_leave(intake, &places[i], true, 8);
	assert_int_equal(intake_look(intake).taken, 0);
	intake_destroy(intake);
}

/* Keeps `depth` places taken while so many are answered, each so long after the one before. */
static double answer_steadily(struct intake *intake, int depth, int count, double each_ms, double now_ms)
{
	struct intake_place places[64] = {0};
	double late_ms;
	for (int i = 0; i < depth; i++)
		assert_int_equal(intake_enter(intake, &places[i], i * each_ms, now_ms, &late_ms), INTAKE_TAKEN);
	for (int i = 0; i < count; i++) {
		now_ms += each_ms;
		intake_leave(intake, &places[i % depth], true, now_ms);
		assert_int_equal(intake_enter(intake, &places[i % depth], (depth - 1) * each_ms, now_ms, &late_ms), INTAKE_TAKEN);
	}
	for (int i = 0; i < depth; i++)
		intake_leave(intake, &places[i], false, now_ms);
	return now_ms;
}

static void the_service_time_is_that_between_answers(void **state)
{
	(void)state;
	struct intake *intake = intake_create(40);
	assert_float_equal(intake_look(intake).service_ms, 0, 0);
	double now_ms = answer_steadily(intake, 8, 60, 25, 1000);
	assert_float_equal(intake_look(intake).service_ms, 25, 1e-6);
	/* Not while there is little to do: then it is the time between requests. */
	now_ms = answer_steadily(intake, 2, 60, 1000, now_ms);
	now_ms += 1e6;
	assert_float_equal(intake_look(intake).service_ms, 25, 1e-6);
	answer_steadily(intake, 8, 200, 50, now_ms);
	assert_float_equal(intake_look(intake).service_ms, 50, 0.1);
	intake_destroy(intake);
}

static void places_are_given_by_time(void **state)
{
	(void)state;
	enum { PLACES = 40 };
	struct intake *intake = intake_create(PLACES);
	struct intake_place places[PLACES] = {0};
	double late_ms, now_ms = answer_steadily(intake, 8, 60, 25, 1000);
	int taken = 0;
	/* The first quarter, whatever is ahead of them: a long picture that runs, for instance. */
	for (; taken < PLACES / 4; taken++)
		assert_int_equal(intake_enter(intake, &places[taken], 1e6, now_ms, &late_ms), INTAKE_TAKEN);
	assert_int_equal(intake_enter(intake, &places[taken], 1e6, now_ms, &late_ms), INTAKE_LONG);
	assert_true(late_ms > 1e6 - PLACES * 25.0 && late_ms < 1e6);
	/* With a part of the margin to spare, and a part too much. */
	const double allowed_ms = 1e6 - late_ms;
	assert_true(allowed_ms > 0 && allowed_ms < PLACES * 25.0);
	assert_int_equal(intake_enter(intake, &places[taken], allowed_ms + 1, now_ms, &late_ms), INTAKE_LONG);
	assert_float_equal(late_ms, 1, 1e-6);
	for (; taken < PLACES; taken++)
		assert_int_equal(intake_enter(intake, &places[taken], allowed_ms - 1, now_ms, &late_ms), INTAKE_TAKEN);
	/* Who is answered later than foreseen makes the margin wider; who leaves without an answer says nothing. */
	const double margin = intake_look(intake).margin;
	intake_leave(intake, &places[PLACES - 1], false, now_ms + 1e6);
	assert_float_equal(intake_look(intake).margin, margin, 0);
	intake_leave(intake, &places[PLACES - 2], true, now_ms + 1e6);
	assert_true(intake_look(intake).margin > margin + 0.9);
	for (int i = 0; i < PLACES; i++)
		intake_leave(intake, &places[i], false, now_ms);
	intake_destroy(intake);
}

/* As when a renderer is made anew: all who wait are late. That neither closes the line nor lasts. */
static void a_pause_is_forgotten(void **state)
{
	(void)state;
	enum { PLACES = 40, TAKEN = 20 };
	struct intake *intake = intake_create(PLACES);
	struct intake_place places[TAKEN] = {0};
	double late_ms, now_ms = answer_steadily(intake, 12, 60, 25, 1000);
	for (int pause = 0; pause < 4; pause++) {
		for (int i = 0; i < TAKEN; i++)
			assert_int_equal(intake_enter(intake, &places[i], 10, now_ms, &late_ms), INTAKE_TAKEN);
		now_ms += 10000;
		for (int i = 0; i < TAKEN; i++)
			intake_leave(intake, &places[i], true, now_ms += 25);
	}
	assert_true(intake_look(intake).margin > 15);
	/* The line is shorter than half of the places, and longer than a quarter. */
	now_ms = answer_steadily(intake, 14, 8000, 25, now_ms);
	assert_true(intake_look(intake).margin < 5);
	assert_float_equal(intake_look(intake).service_ms, 25, 0.1);
	intake_destroy(intake);
}

/* --- an overload ------------------------------------------------------------------------------------------------------------------- */

/* Requests of one client at random times, for pictures of three kinds, one of which takes three times as long as the others; predicted
 * badly; rendered one after the other in fair order, then encoded. The mix of tests/load. */
enum { WEIGHTS = 9, ENCODE_MS = 10, ANSWERS_MAX = 20000 };
static const double cost_of_kind[WEIGHTS] = {20, 20, 20, 20, 20, 20, 25, 25, 70};
static const double mean_ms = 240.0 / WEIGHTS;

struct picture {
	struct fair_entry entry; /* first */
	struct intake_place place;
	double came_ms, true_ms, encoded_ms;
	struct picture *next;
};

struct world {
	struct intake *intake;
	struct fair_order *order;
	uint64_t seed;
	double now_ms, comes_ms, rendered_ms, waiting_ms;
	struct picture *running, *encoding, **last_encoding;
	double took_ms[ANSWERS_MAX], seconds;
	int answers, dear;
};

/* Not rand(): the same everywhere. */
static double draw(struct world *world)
{
	world->seed = world->seed * 6364136223846793005u + 1442695040888963407u;
	return ((double)(world->seed >> 11) + 0.5) / 9007199254740992.0;
}

static double draw_normal(struct world *world)
{
	const double radius = sqrt(-2 * log(draw(world)));
	return radius * cos(2 * M_PI * draw(world));
}

static void come(struct world *world, double rate)
{
	struct picture *picture = calloc(1, sizeof *picture);
	const double cost_ms = cost_of_kind[(int)(WEIGHTS * draw(world))];
	const double left_ms =
		world->running ? fmax(world->running->entry.cost_ms - (world->now_ms - world->rendered_ms + world->running->true_ms), 0)
			       : 0;
	double late_ms;
	world->comes_ms = world->now_ms - log(draw(world)) * mean_ms / rate;
	*picture = (struct picture){.came_ms = world->now_ms, .true_ms = cost_ms * (0.9 + 0.2 * draw(world))};
	picture->entry.cost_ms = cost_ms * exp(0.35 * draw_normal(world));
	if (intake_enter(world->intake, &picture->place, world->waiting_ms + left_ms, world->now_ms, &late_ms) != INTAKE_TAKEN) {
		free(picture);
		return;
	}
	fair_order_add(world->order, &picture->entry, world->now_ms);
	world->waiting_ms += picture->entry.cost_ms;
}

static void render_next(struct world *world)
{
	struct picture *picture = (struct picture *)fair_order_first(world->order, NULL, NULL);
	world->running = picture;
	if (!picture)
		return;
	fair_order_take(world->order, &picture->entry);
	world->waiting_ms -= picture->entry.cost_ms;
	world->rendered_ms = world->now_ms + picture->true_ms;
}

static void end_rendering(struct world *world)
{
	struct picture *picture = world->running;
	fair_order_settle(world->order, &picture->entry, picture->true_ms);
	picture->encoded_ms = world->now_ms + ENCODE_MS;
	*world->last_encoding = picture;
	world->last_encoding = &picture->next;
	world->running = NULL;
}

static void end_encoding(struct world *world)
{
	struct picture *picture = world->encoding;
	world->encoding = picture->next;
	if (!world->encoding)
		world->last_encoding = &world->encoding;
	intake_leave(world->intake, &picture->place, true, world->now_ms);
	/* After as many as it takes to fill the line a few times. */
	if (picture->came_ms > 5000 && world->answers < ANSWERS_MAX) {
		world->took_ms[world->answers++] = world->now_ms - picture->came_ms;
		world->dear += picture->true_ms > 50;
	}
	free(picture);
}

static void step(struct world *world, double rate)
{
	const double rendered_ms = world->running ? world->rendered_ms : INFINITY;
	const double encoded_ms = world->encoding ? world->encoding->encoded_ms : INFINITY;
	world->now_ms = fmin(world->comes_ms, fmin(rendered_ms, encoded_ms));
	if (world->now_ms == encoded_ms)
		end_encoding(world);
	else if (world->now_ms == rendered_ms)
		end_rendering(world);
	else
		come(world, rate);
	if (!world->running)
		render_next(world);
}

static int compare_times(const void *a, const void *b)
{
	const double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

struct figures {
	double p99, goodput, dear; /* over what a full line takes; over what there is time for; share of the dear ones */
};

static struct figures simulate(size_t places, double rate, uint64_t seed)
{
	struct world *world = calloc(1, sizeof *world);
	assert_non_null(world);
	world->intake = intake_create(places);
	world->order = fair_order_create();
	world->last_encoding = &world->encoding;
	world->seed = seed;
	while (world->now_ms < 105000)
		step(world, rate);
	qsort(world->took_ms, (size_t)world->answers, sizeof *world->took_ms, compare_times);
	const struct figures figures = {
		.p99 = world->took_ms[world->answers * 99 / 100] / ((double)places * mean_ms),
		.goodput = world->answers * mean_ms / 100000,
		.dear = (double)world->dear / world->answers,
	};
	world->comes_ms = INFINITY;
	while (world->running || world->encoding)
		step(world, rate);
	assert_int_equal(intake_look(world->intake).taken, 0);
	fair_order_destroy(world->order);
	intake_destroy(world->intake);
	free(world);
	return figures;
}

/* Whatever is offered: who is taken is answered in time, and as much is done as there is time for. */
static void an_overload_keeps_to_the_bound(void **state)
{
	(void)state;
	static const size_t places[] = {16, 32, 64, 128};
	for (size_t i = 0; i < sizeof places / sizeof *places; i++)
		for (double rate = 1; rate <= 4; rate *= 2)
			for (uint64_t seed = 1; seed <= 3; seed++) {
				const struct figures figures = simulate(places[i], rate, seed);
				assert_true(figures.p99 <= 1);
				assert_true(figures.goodput >= (rate > 1 ? 0.95 : 0.83)); /* at 1 there are gaps */
				/* As many dear ones as are asked for: 1 of 9. */
				assert_true(figures.dear > 0.08 && figures.dear < 0.14);
			}
}

/* --- many threads ------------------------------------------------------------------------------------------------------------------ */

static void *come_and_go(void *context)
{
	for (int i = 0; i < 2000; i++) {
		struct intake_place place = {0};
		double late_ms;
		if (intake_enter(context, &place, i % 50, i, &late_ms) == INTAKE_TAKEN)
			assert_true(intake_look(context).taken <= 3);
		intake_leave(context, &place, i % 3, i + 1);
	}
	return NULL;
}

static void many_threads(void **state)
{
	(void)state;
	pthread_t threads[6];
	struct intake *intake = intake_create(3);
	for (int i = 0; i < 6; i++)
		assert_int_equal(pthread_create(&threads[i], NULL, come_and_go, intake), 0);
	for (int i = 0; i < 6; i++)
		pthread_join(threads[i], NULL);
	assert_int_equal(intake_look(intake).taken, 0);
	intake_destroy(intake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(as_many_as_there_are),           cmocka_unit_test(the_service_time_is_that_between_answers),
		cmocka_unit_test(places_are_given_by_time),       cmocka_unit_test(a_pause_is_forgotten),
		cmocka_unit_test(an_overload_keeps_to_the_bound), cmocka_unit_test(many_threads),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
