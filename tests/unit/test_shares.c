/* What each client may have of the places in a line. */
#include "server/shares.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

static size_t take_all(struct shares *shares, const char *client)
{
	while (shares_allow(shares, client))
		shares_take(shares, client);
	return shares_of(shares, client);
}

static void one_has_half(void **state)
{
	(void)state;
	for (size_t places = 1; places <= 65; places++) {
		struct shares *shares = shares_create(places);
		assert_int_equal(take_all(shares, "one"), (places + 1) / 2);
		assert_int_equal(shares_taken(shares), (places + 1) / 2);
		assert_int_equal(shares_allow(shares, "new"), places > 1);
		assert_int_equal(take_all(shares, NULL), places - (places + 1) / 2); /* nobody in particular: all that is left */
		assert_false(shares_allow(shares, "new"));
		shares_destroy(shares);
	}
}

/* Each takes all it may, again and again: a place is left for whoever comes new. */
static void many_leave_a_place(void **state)
{
	(void)state;
	enum { PLACES = 32 };
	for (int clients = 1; clients < PLACES; clients++) {
		struct shares *shares = shares_create(PLACES);
		char client[16];
		size_t sum = 0;
		for (int turn = 0; turn < PLACES * clients; turn++) {
			snprintf(client, sizeof client, "%d", turn % clients);
			if (shares_allow(shares, client))
				shares_take(shares, client);
		}
		for (int i = 0; i < clients; i++) {
			snprintf(client, sizeof client, "%d", i);
			sum += shares_of(shares, client);
			assert_in_range(shares_of(shares, client), PLACES / (clients + 1), PLACES / (clients + 1) + 1);
		}
		assert_int_equal(shares_taken(shares), sum);
		assert_true(shares_allow(shares, "new"));
		shares_destroy(shares);
	}
}

static void what_is_given_back_is_free(void **state)
{
	(void)state;
	struct shares *shares = shares_create(8);
	assert_int_equal(take_all(shares, "one"), 4);
	assert_int_equal(take_all(shares, "two"), 2);
	shares_take(shares, NULL);
	shares_give(shares, "two");
	shares_give(shares, "two");
	assert_int_equal(shares_of(shares, "two"), 0);
	assert_false(shares_allow(shares, "one"));
	shares_give(shares, NULL);
	for (int i = 0; i < 4; i++)
		shares_give(shares, "one");
	assert_int_equal(shares_taken(shares), 0);
	assert_int_equal(take_all(shares, "two"), 4);
	/* Beyond what it may: admitted elsewhere. */
	for (int i = 0; i < 8; i++)
		shares_take(shares, "two");
	assert_int_equal(shares_taken(shares), 12);
	assert_false(shares_allow(shares, "new"));
	shares_destroy(shares);
	shares_destroy(NULL);
}

static void who_comes_before(void **state)
{
	(void)state;
	struct shares *shares = shares_create(100);
	for (int i = 0; i < 30; i++)
		shares_take(shares, "many");
	for (int i = 0; i < 3; i++)
		shares_take(shares, "some");
	assert_int_equal(shares_before(shares, "new"), 0);
	assert_int_equal(shares_before(shares, "some"), 3 + 3);
	assert_int_equal(shares_before(shares, "many"), 30 + 3);
	shares_take(shares, NULL);
	assert_int_equal(shares_before(shares, "some"), 3 + 3 + 1);
	assert_int_equal(shares_before(shares, NULL), 1 + 1 + 1);
	shares_destroy(shares);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(one_has_half),
		cmocka_unit_test(many_leave_a_place),
		cmocka_unit_test(what_is_given_back_is_free),
		cmocka_unit_test(who_comes_before),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
