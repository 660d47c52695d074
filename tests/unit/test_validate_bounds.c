/* What `make validate` judges by: every bound must break when its values are off, not measured, or no numbers. */
#include "tests/validate/bounds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

/* Tallies that just hold: of a share 99 in 100, of all others the lowest limit of their bounds. */
static struct measurements just_good(void)
{
	struct measurements all = {0};
	for (int id = 0; id < TALLY_COUNT; id++) {
		double limit = INFINITY;
		bool share = false;
		for (int i = 0; i < BOUND_COUNT; i++) {
			if (bounds[i].tally != (enum tally_id)id)
				continue;
			share = share || bounds[i].statistic == STATISTIC_SHARE;
			limit = fmin(limit, bounds[i].limit);
		}
		for (int i = 0; i < 100; i++)
			tally_add(&all.tally[id], share ? i == 7 ? 1.5 : 0.5 : 0.999 * limit, "value %d", i);
	}
	return all;
}

static void every_tally_is_judged(void **state)
{
	(void)state;
	for (int id = 0; id < TALLY_COUNT; id++) {
		int judges = 0;
		for (int i = 0; i < BOUND_COUNT; i++)
			judges += bounds[i].tally == (enum tally_id)id;
		assert_true(judges > 0);
	}
}

static void good_values_hold(void **state)
{
	(void)state;
	struct measurements all = just_good();
	for (int i = 0; i < BOUND_COUNT; i++)
		assert_int_equal(bound_judge(&bounds[i], &all), VERDICT_REACHED);
	assert_true(bounds_hold(&all));
}

/* One bound after the other, all the rest being good. */
static void one_bad_value_breaks(void **state)
{
	(void)state;
	for (int i = 0; i < BOUND_COUNT; i++) {
		struct measurements all = just_good();
		struct tally *tally = &all.tally[bounds[i].tally];
		if (bounds[i].statistic == STATISTIC_SHARE) {
			tally_add(tally, 1.001, "here");
			tally_add(tally, 1.001, "here");
		} else if (bounds[i].statistic == STATISTIC_RMS) {
			tally_add(tally, 11 * bounds[i].limit, "here"); /* 1.5 times of 101 */
			tally_add(tally, 11 * bounds[i].limit, "here");
		} else {
			tally_add(tally, 1.001 * bounds[i].tolerance * bounds[i].limit, "here");
			assert_string_equal(tally->where, "here");
		}
		assert_int_equal(bound_judge(&bounds[i], &all), VERDICT_BROKEN);
		assert_false(bounds_hold(&all));
	}
}

static void times_are_tolerated(void **state)
{
	(void)state;
	int tolerant = 0;
	for (int i = 0; i < BOUND_COUNT; i++) {
		if (bounds[i].tolerance == 1)
			continue;
		struct measurements all = just_good();
		tally_add(&all.tally[bounds[i].tally], 1.5 * bounds[i].limit, "here");
		assert_int_equal(bound_judge(&bounds[i], &all), VERDICT_TOLERATED);
		assert_true(bounds_hold(&all));
		assert_string_equal(bounds[i].unit, "ms");
		tolerant++;
	}
	assert_int_equal(tolerant, 4);
}

static void what_was_not_measured_breaks(void **state)
{
	(void)state;
	for (int id = 0; id < TALLY_COUNT; id++) {
		struct measurements all = just_good();
		all.tally[id] = (struct tally){0};
		assert_false(bounds_hold(&all));
		all = just_good();
		tally_add(&all.tally[id], NAN, "lost");
		tally_add(&all.tally[id], 0, "later");
		const bool share = id == TALLY_PHOTON_FLUX || id == TALLY_PHOTON_RADIANCE || id == TALLY_PATHS_LAYER;
		assert_true(share == bounds_hold(&all) || all.tally[id].within < 0.99 * (double)all.tally[id].count);
		assert_string_equal(all.tally[id].where, "lost");
	}
}

static void one_part_is_judged_alone(void **state)
{
	(void)state;
	char text[4096] = "";
	struct measurements one = {.of_one_part = true};
	assert_false(bounds_hold(&one)); /* nothing at all */
	tally_add(&one.tally[TALLY_CONSERVATION], 0, "tau 3");
	assert_true(bounds_hold(&one));
	FILE *file = fmemopen(text, sizeof text, "w");
	assert_non_null(file);
	bounds_print(file, &one);
	fclose(file);
	assert_null(strstr(text, "no number"));
	assert_non_null(strstr(text, "| R + T = 1, independent sums |"));
	tally_add(&one.tally[TALLY_CONSERVATION], 0.02, "tau 3");
	assert_false(bounds_hold(&one));
}

/* The table names the broken one. */
static void table_says_so(void **state)
{
	(void)state;
	char text[16384];
	struct measurements all = just_good();
	tally_add(&all.tally[TALLY_CONSERVATION], 0.02, "tau 3");
	FILE *file = fmemopen(text, sizeof text, "w");
	assert_non_null(file);
	bounds_print(file, &all);
	fclose(file);
	assert_non_null(strstr(text, "| R + T = 1, independent sums | 0.02 | 0.001 | **no** | 101 | tau 3 |\n"));
	const char *first = strstr(text, "**no**");
	assert_null(strstr(first + 1, "**no**"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_tally_is_judged),
		cmocka_unit_test(good_values_hold),
		cmocka_unit_test(one_bad_value_breaks),
		cmocka_unit_test(times_are_tolerated),
		cmocka_unit_test(what_was_not_measured_breaks),
		cmocka_unit_test(one_part_is_judged_alone),
		cmocka_unit_test(table_says_so),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
