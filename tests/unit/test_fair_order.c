/* The order that is fair to clients: simulated service of known costs. */
#include "server/fair_order.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { CLIENTS = 8, JOBS = 4000 };

struct job {
	struct fair_entry entry;
	int client;
	double true_ms, came_ms, began_ms;
	bool done;
};

struct world {
	struct fair_order *order;
	double now_ms;
	struct job jobs[JOBS];
	int made;
	char names[JOBS][16];
};

static struct world *begin(void)
{
	struct world *world = calloc(1, sizeof *world);
	assert_non_null(world);
	world->order = fair_order_create();
	assert_non_null(world->order);
	return world;
}

static void end(struct world *world)
{
	assert_null(fair_order_first(world->order, NULL, NULL));
	fair_order_destroy(world->order);
	free(world);
}

static struct job *add(struct world *world, int client, double predicted_ms, double true_ms)
{
	struct job *job = &world->jobs[world->made];
	char *name = world->names[world->made++];
	assert_true(world->made < JOBS);
	snprintf(name, sizeof world->names[0], "client %d", client); /* equal keys, not equal pointers */
	*job = (struct job){
		.entry = {.client = name, .cost_ms = predicted_ms}, .client = client, .true_ms = true_ms, .came_ms = world->now_ms};
	fair_order_add(world->order, &job->entry, world->now_ms);
	return job;
}

static struct job *take(struct world *world)
{
	struct job *job = (struct job *)fair_order_first(world->order, NULL, NULL);
	if (job) {
		fair_order_take(world->order, &job->entry);
		job->began_ms = world->now_ms;
		world->now_ms += job->true_ms;
	}
	return job;
}

static void settle(struct world *world, struct job *job)
{
	fair_order_settle(world->order, &job->entry, job->true_ms);
	assert_false(job->done);
	job->done = true;
}

static struct job *serve(struct world *world)
{
	struct job *job = take(world);
	if (job)
		settle(world, job);
	return job;
}

/* A batch of 50 from one client; each preview of another waits for the running job alone, whenever it comes. */
static void batch_delays_a_preview_by_the_running_job(void **state)
{
	(void)state;
	struct world *world = begin();
	for (int i = 0; i < 50; i++)
		add(world, 0, 1500, 1500);
	for (int i = 0; i < 20; i++) {
		struct job *running = take(world);
		assert_int_equal(running->client, 0);
		struct job *preview = add(world, 1, 100, 100);
		settle(world, running);
		assert_ptr_equal(serve(world), preview);
	}
	while (serve(world))
		;
	end(world);
}

/* The same where neither is predicted well. */
static void wrong_predictions_do_not_help_a_batch(void **state)
{
	(void)state;
	struct world *world = begin();
	for (int i = 0; i < 50; i++)
		add(world, 0, 150, 1500);
	for (int i = 0; i < 5; i++)
		serve(world);
	struct job *running = take(world);
	struct job *preview = add(world, 1, 100, 100);
	settle(world, running);
	assert_ptr_equal(serve(world), preview);
	while (serve(world))
		;
	end(world);
}

/* Clients that always have work get the same time, whatever the size of what they ask for: within the largest of each. */
static void shares_are_equal(void **state)
{
	(void)state;
	static const double sizes[CLIENTS] = {10, 20, 40, 80, 160, 320, 640, 1280};
	struct world *world = begin();
	double served[CLIENTS] = {0};
	srand(1);
	for (int client = 0; client < CLIENTS; client++)
		for (int i = 0; i < 3; i++)
			add(world, client, sizes[client], sizes[client]);
	for (struct job *job; world->made < JOBS - CLIENTS && (job = serve(world));) {
		served[job->client] += job->true_ms;
		const double factor = 0.25 + 1.5 * rand() / RAND_MAX; /* what is predicted is off */
		add(world, job->client, sizes[job->client] * factor, sizes[job->client]);
		for (int a = 0; a < CLIENTS; a++)
			for (int b = 0; b < a; b++)
				assert_true(fabs(served[a] - served[b]) <= 1.75 * (sizes[a] + sizes[b]) + 1e-6);
	}
	while (serve(world))
		;
	end(world);
}

/* New clients come as fast as they are served, 20 of them waiting; still who waits is served, at its share of 1/21. */
static void new_clients_starve_nobody(void **state)
{
	(void)state;
	enum { NEW = 20 };
	struct world *world = begin();
	struct job *old[3];
	for (int i = 0; i < 3; i++)
		old[i] = add(world, 0, 200, 200);
	for (int i = 0; i < NEW; i++)
		add(world, 1 + i, 10, 10);
	while (!old[2]->done && world->made < JOBS - 1) {
		add(world, world->made, 10, 10);
		assert_non_null(serve(world));
	}
	for (int i = 0; i < 3; i++) {
		assert_true(old[i]->done);
		assert_true(old[i]->began_ms <= 1.3 * (NEW + 1) * 200 * i + 500);
	}
	while (serve(world))
		;
	end(world);
}

/* Of one client the small go first, but none of the large waits for longer than its patience. */
static void small_before_large_within_reason(void **state)
{
	(void)state;
	struct world *world = begin();
	struct job *large = add(world, 0, 1000, 1000), *small = add(world, 0, 50, 50);
	assert_ptr_equal(serve(world), small);
	while (!large->done) {
		add(world, 0, 50, 50);
		serve(world);
	}
	assert_true(large->began_ms - large->came_ms <= FAIR_ORDER_PATIENCE * 1000 + 50);
	assert_true(large->began_ms - large->came_ms >= 1000);
	while (serve(world))
		;
	end(world);
}

static bool is_of_client(struct fair_entry *entry, void *context)
{
	return ((struct job *)entry)->client == *(int *)context;
}

static void wanted_and_dropped(void **state)
{
	(void)state;
	struct world *world = begin();
	int two = 2, three = 3;
	struct job *first = add(world, 1, 10, 10), *second = add(world, 2, 10, 10), *third = add(world, 2, 5, 5);
	assert_ptr_equal(fair_order_first(world->order, is_of_client, &two), &third->entry);
	assert_null(fair_order_first(world->order, is_of_client, &three));
	fair_order_drop(world->order, &third->entry);
	assert_ptr_equal(fair_order_first(world->order, is_of_client, &two), &second->entry);
	/* What is dropped costs its client nothing. */
	fair_order_drop(world->order, &first->entry);
	first = add(world, 1, 9, 9);
	assert_ptr_equal(serve(world), first);
	assert_ptr_equal(serve(world), second);
	end(world);
}

/* What is said to come before an entry does, when nothing else comes. */
static void work_ahead(void **state)
{
	(void)state;
	struct world *world = begin();
	srand(7);
	double worst = 0;
	for (int round = 0; round < 200; round++) {
		for (int i = 0; i < 12; i++) {
			const double cost = 10 + rand() % 200;
			add(world, rand() % 4, cost, cost);
		}
		for (int i = rand() % 8; i > 0; i--)
			serve(world);
		char name[16];
		const int client = rand() % 5;
		const double cost = 10 + rand() % 200;
		snprintf(name, sizeof name, "client %d", client);
		const double ahead = fair_order_ahead_ms(world->order, name, cost, world->now_ms);
		struct job *job = add(world, client, cost, cost);
		while (serve(world))
			;
		worst = fmax(worst, fabs(job->began_ms - job->came_ms - ahead));
		world->made = 0;
	}
	/* Equal tags go by cost, which is not foreseen: at most one job of each other client. */
	assert_true(worst <= 4 * 210);
	end(world);
}

/* Who asks for what another has last in a batch has it served in its own turn, and pays for it. */
static void shared_work_goes_where_it_is_sooner(void **state)
{
	(void)state;
	struct world *world = begin();
	struct job *batch[10], *running;
	for (int i = 0; i < 10; i++)
		batch[i] = add(world, 0, 100, 100);
	running = take(world);
	const double before_ms = fair_order_ahead_of_ms(world->order, &batch[9]->entry, "client 0", world->now_ms);
	assert_float_equal(before_ms, 800, 1e-9);
	assert_float_equal(fair_order_ahead_of_ms(world->order, &batch[9]->entry, "client 1", world->now_ms), 0, 1e-9);
	assert_false(fair_order_share(world->order, &batch[9]->entry, "client 0", world->now_ms));
	assert_true(fair_order_share(world->order, &batch[9]->entry, "client 1", world->now_ms));
	assert_float_equal(fair_order_ahead_of_ms(world->order, &batch[9]->entry, "client 2", world->now_ms), 0, 1e-9);
	struct job *other = add(world, 1, 100, 100), *third = add(world, 2, 120, 120);
	settle(world, running);
	assert_ptr_equal(serve(world), batch[9]);
	assert_ptr_equal(serve(world), third); /* who has paid nothing comes first, ... */
	struct job *next[2] = {serve(world), serve(world)};
	assert_true(next[0] == other || next[1] == other); /* ... then the one with the batch and the one who shared in turns */
	assert_true(next[0] == batch[1] || next[1] == batch[1]);
	while (serve(world))
		;
	for (int i = 0; i < 10; i++)
		assert_true(batch[i]->done);
	end(world);
}

/* It stays where it is when the other's line is longer, or is empty and far ahead; and what empties a line leaves nothing behind. */
static void shared_work_stays_where_it_is_sooner(void **state)
{
	(void)state;
	struct world *world = begin();
	struct job *only = add(world, 0, 100, 100);
	for (int i = 0; i < 3; i++)
		add(world, 1, 100, 100);
	assert_false(fair_order_share(world->order, &only->entry, "client 1", world->now_ms));
	struct job *last = &world->jobs[3];
	assert_true(fair_order_share(world->order, &last->entry, "client 2", world->now_ms));
	assert_false(fair_order_share(world->order, &last->entry, "client 3", world->now_ms)); /* as soon */
	fair_order_drop(world->order, &last->entry);
	int left = 0;
	while (serve(world))
		left++;
	assert_true(left == 3 && only->done);
	end(world);
}

/* Idle ones are forgotten: a busy period of many clients that each come once does not grow. */
static void everything_is_served_once(void **state)
{
	(void)state;
	struct world *world = begin();
	srand(3);
	int served = 0;
	while (world->made < JOBS - 4) {
		for (int i = rand() % 4; i > 0; i--)
			add(world, rand() % 500, 1 + rand() % 100, 1 + rand() % 100);
		served += serve(world) != NULL;
	}
	while (serve(world))
		served++;
	assert_int_equal(served, world->made);
	for (int i = 0; i < world->made; i++)
		assert_true(world->jobs[i].done);
	end(world);
}

static void without_a_client(void **state)
{
	(void)state;
	struct fair_order *order = fair_order_create();
	struct fair_entry one = {.cost_ms = 5}, two = {.client = "", .cost_ms = 1};
	fair_order_add(order, &one, 0);
	fair_order_add(order, &two, 0);
	assert_ptr_equal(fair_order_first(order, NULL, NULL), &two);
	fair_order_drop(order, &two);
	fair_order_take(order, &one);
	fair_order_settle(order, &one, 5);
	fair_order_destroy(order);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(batch_delays_a_preview_by_the_running_job),
		cmocka_unit_test(wrong_predictions_do_not_help_a_batch),
		cmocka_unit_test(shares_are_equal),
		cmocka_unit_test(new_clients_starve_nobody),
		cmocka_unit_test(small_before_large_within_reason),
		cmocka_unit_test(wanted_and_dropped),
		cmocka_unit_test(work_ahead),
		cmocka_unit_test(shared_work_goes_where_it_is_sooner),
		cmocka_unit_test(shared_work_stays_where_it_is_sooner),
		cmocka_unit_test(everything_is_served_once),
		cmocka_unit_test(without_a_client),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
