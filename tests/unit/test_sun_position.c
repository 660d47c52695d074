/* RFC 3339 and the position of the sun, against published values. */
#include "server/rfc3339.h"
#include "server/sun_position.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static void test_times(void **state)
{
	(void)state;
	static const struct {
		const char *text;
		double julian_day;
	} good[] = {
		{"2000-01-01T12:00:00Z", 2451545.0},
		{"2000-01-01t12:00:00z", 2451545.0},
		{"1970-01-01T00:00:00Z", 2440587.5},
		{"2000-01-01T14:30:00+02:30", 2451545.0},
		{"1999-12-31T23:00:00-13:00", 2451545.0},
		{"2000-02-29T12:00:00Z", 2451604.0},
		{"2016-12-31T23:59:60Z", 2457754.5},
		{"2017-01-01T00:59:60+01:00", 2457754.5},
		{"0000-03-01T00:00:00Z", 1721119.5},
		{"9999-12-31T00:00:00Z", 5373483.5},
		{"2000-01-01T11:59:59.999999999999Z", 2451545.0},
	};
	double julian_day;
	for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
		if (!rfc3339_parse(good[i].text, &julian_day) || fabs(julian_day - good[i].julian_day) > 1e-8)
			fail_msg("%s: %.9f", good[i].text, julian_day);
	}
	static const char *const bad[] = {"",
					  "2000-01-01",
					  "2000-01-01T12:00:00",
					  "2000-01-01 12:00:00Z",
					  "2000-01-01T12:00Z",
					  "2000-1-01T12:00:00Z",
					  "2000-13-01T12:00:00Z",
					  "2000-00-01T12:00:00Z",
					  "2000-01-32T12:00:00Z",
					  "2001-02-29T12:00:00Z",
					  "1900-02-29T12:00:00Z",
					  "2000-01-01T24:00:00Z",
					  "2000-01-01T12:60:00Z",
					  "2000-01-01T12:00:61Z",
					  "2000-01-01T12:00:60Z",
					  "2000-01-01T12:00:00.Z",
					  "2000-01-01T12:00:00+0200",
					  "2000-01-01T12:00:00+24:00",
					  "2000-01-01T12:00:00ZZ",
					  "+2000-01-01T12:00:00Z",
					  "99999-01-01T12:00:00Z",
					  "0000-01-01T00:00:00+01:00",
					  "9999-12-31T23:59:59-01:00"};
	for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
		if (rfc3339_parse(bad[i], &julian_day))
			fail_msg("%s is taken", bad[i]);
}

static void test_time_texts(void **state)
{
	(void)state;
	static const char *const cases[][2] = {
		{"2003-10-17T12:30:30-07:00", "2003-10-17T19:30:30Z"},   {"2003-10-17T19:30:30.5Z", "2003-10-17T19:30:30.500Z"},
		{"2000-02-29T23:59:59.9996Z", "2000-03-01T00:00:00Z"},   {"2016-12-31T23:59:60Z", "2017-01-01T00:00:00Z"},
		{"0000-01-01T00:00:00Z", "0000-01-01T00:00:00Z"},        {"1969-12-31T23:59:59.001Z", "1969-12-31T23:59:59.001Z"},
		{"9999-12-31T23:59:59.999Z", "9999-12-31T23:59:59.999Z"}};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		double first, second;
		char text[RFC3339_SIZE];
		assert_true(rfc3339_parse(cases[i][0], &first));
		rfc3339_format(first, text);
		assert_string_equal(text, cases[i][1]);
		assert_true(rfc3339_parse(text, &second));
		assert_true(first == second);
	}
	/* Every day of four centuries. */
	for (int day = 0; day < 146097; day++) {
		const double julian_day = 2305447.5 + day + (day % 86400) / 86400.0;
		double back;
		char text[RFC3339_SIZE];
		rfc3339_format(julian_day, text);
		assert_true(rfc3339_parse(text, &back));
		assert_float_equal(back, julian_day, 1e-8);
	}
}

static struct scene_sun sun_at(const char *time, double latitude, double longitude)
{
	double julian_day;
	assert_true(rfc3339_parse(time, &julian_day));
	return sun_position_at(julian_day, latitude, longitude);
}

/* The worked example of NREL/TP-560-34302 (SPA): topocentric elevation 39.872046 before refraction, azimuth 194.340241. */
static void test_spa_example(void **state)
{
	(void)state;
	struct scene_sun sun = sun_at("2003-10-17T12:30:30-07:00", 39.742476, -105.1786);
	assert_true(fabs(sun.elevation_deg - 39.872046) < 0.002);
	assert_true(fabs(sun.azimuth_deg - 194.340241) < 0.002);
}

/* At the pole the elevation is the declination: solstices and equinoxes by their published minutes, over a century, so that the drift of
 * the equinox would show. */
static void test_seasons(void **state)
{
	(void)state;
	static const struct {
		const char *time;
		double declination;
	} cases[] = {{"2024-06-20T20:51:00Z", 23.438}, {"2024-12-21T09:20:00Z", -23.438}, {"2024-03-20T03:06:00Z", 0},
		     {"2024-09-22T12:44:00Z", 0},      {"2050-03-20T10:19:00Z", 0},       {"1950-03-21T04:35:00Z", 0}};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		double elevation = sun_at(cases[i].time, 90, 0).elevation_deg;
		if (fabs(elevation - cases[i].declination) > 0.005)
			fail_msg("%s: %.4f", cases[i].time, elevation);
	}
}

/* Noon: due south north of the tropic, due north south of it; east in the morning. */
static void test_directions(void **state)
{
	(void)state;
	struct scene_sun south = sun_at("2024-06-20T12:01:45Z", 50, 0), north = sun_at("2024-06-20T12:01:45Z", -35, 0);
	assert_true(fabs(south.azimuth_deg - 180) < 0.1 && fabs(south.elevation_deg - (90 - 50 + 23.44)) < 0.02);
	assert_true(fmin(north.azimuth_deg, 360 - north.azimuth_deg) < 0.1 && fabs(north.elevation_deg - (90 - 35 - 23.44)) < 0.02);
	assert_true(sun_at("2024-03-20T07:00:00Z", 45, 0).azimuth_deg < 180);
	assert_true(sun_at("2024-03-20T17:00:00Z", 45, 0).azimuth_deg > 180);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_times),   cmocka_unit_test(test_time_texts), cmocka_unit_test(test_spa_example),
		cmocka_unit_test(test_seasons), cmocka_unit_test(test_directions),
	};
	return cmocka_run_group_tests_name("sun_position", tests, NULL, NULL);
}
