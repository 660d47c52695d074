/* Latencies in log-linear buckets: against sorted lists, over ranges from nanoseconds to minutes. */
#include "clients/bench/histogram.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

enum { VALUES = 20000 };

static int by_value(const void *a, const void *b)
{
	const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
	return (x > y) - (x < y);
}

/* Values over ten powers of ten, the same every time. */
static void fill(int64_t *values, uint64_t state)
{
	for (int i = 0; i < VALUES; i++) {
		state = state * 6364136223846793005u + 1442695040888963407u;
		values[i] = (int64_t)pow(10, 10.0 * (double)(state >> 11) * 0x1p-53);
	}
}

static void test_shares(void **context)
{
	(void)context;
	static const double shares[] = {0, 1e-4, 0.1, 0.5, 0.9, 0.99, 0.999, 0.9999, 1};
	static int64_t values[VALUES];
	struct histogram *histogram = histogram_create();
	double sum = 0;
	fill(values, 1);
	for (int i = 0; i < VALUES; i++) {
		histogram_record(histogram, values[i]);
		sum += (double)values[i];
	}
	qsort(values, VALUES, sizeof *values, by_value);
	assert_int_equal(histogram_count(histogram), VALUES);
	const double mean = sum / VALUES;
	assert_float_equal(histogram_mean(histogram) / mean, 1, 1e-9);
	double squares = 0;
	for (int i = 0; i < VALUES; i++)
		squares += ((double)values[i] - mean) * ((double)values[i] - mean);
	assert_float_equal(histogram_deviation(histogram) / sqrt(squares / VALUES), 1, 1e-6);
	for (size_t i = 0; i < sizeof shares / sizeof *shares; i++) {
		const int rank = (int)ceil(shares[i] * VALUES);
		const int64_t exact = values[rank > 0 ? rank - 1 : 0], got = histogram_at(histogram, shares[i]);
		assert_true(got >= exact && (double)got <= (double)exact * (1 + 1 / 256.0));
	}
	assert_int_equal(histogram_at(histogram, 1), values[VALUES - 1]);
	histogram_destroy(histogram);
}

static void test_every_small_value_is_itself(void **context)
{
	(void)context;
	for (int64_t value = 0; value < 5000; value++) {
		struct histogram *histogram = histogram_create();
		histogram_record(histogram, value);
		histogram_record(histogram, 1 << 20);
		const int64_t got = histogram_at(histogram, 0.5);
		assert_true(got >= value && got - value <= value / 256);
		histogram_destroy(histogram);
	}
}

static void test_ends(void **context)
{
	(void)context;
	struct histogram *histogram = histogram_create();
	assert_int_equal(histogram_at(histogram, 0.5), 0);
	assert_float_equal(histogram_mean(histogram), 0, 0);
	histogram_record(histogram, -5);
	assert_int_equal(histogram_at(histogram, 1), 0);
	histogram_record(histogram, INT64_MAX);
	assert_int_equal(histogram_at(histogram, 1), ((int64_t)1 << 42) - 1);
	histogram_destroy(histogram);
	histogram_destroy(NULL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {cmocka_unit_test(test_shares), cmocka_unit_test(test_every_small_value_is_itself),
					   cmocka_unit_test(test_ends)};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
