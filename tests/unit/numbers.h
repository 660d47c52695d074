/* What the tests of figures share: numbers of reference tables, and how far a value may be from one. */
#ifndef STRATUS_TESTS_NUMBERS_H
#define STRATUS_TESTS_NUMBERS_H

#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

static inline double number(const json_t *object, const char *key)
{
	const json_t *value = json_object_get(object, key);
	assert_true(json_is_number(value));
	return json_number_value(value);
}

static inline double element(const json_t *array, size_t i)
{
	const json_t *value = json_array_get(array, i);
	assert_true(json_is_number(value));
	return json_number_value(value);
}

static inline void assert_near(double value, double expected, double tolerance, const char *what)
{
	if (!(fabs(value - expected) <= tolerance))
		fail_msg("%s: %.9g instead of %.9g (%+.3g)", what, value, expected, value - expected);
}

#endif
