/* The query of /v1/slab: what is read, what goes together, and that nothing else comes through. */
#include "server/slab_query.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static struct problem problem;
static struct slab_query query;

static void read(const char *text)
{
	problem_finish(&problem);
	slab_query_read(text, &query, &problem);
}

static int forget(void **state)
{
	(void)state;
	problem_finish(&problem);
	return 0;
}

static void test_everything_given(void **state)
{
	(void)state;
	read("thickness_m=120.5&sun_zenith_deg=0&view_zenith_deg=90,0,45&relative_azimuth_deg=-360&orders=modified&shading=montecarlo&"
	     "photons=1e6&seed=4294967295&dsd.gamma=5&model.optics=paper");
	assert_int_equal(problem.kind, PROBLEM_NONE);
	assert_true(query.thickness_m == 120.5 && query.optical_thickness == 0 && query.sun_zenith_deg == 0);
	assert_int_equal(query.view_count, 3);
	assert_true(query.view_zenith_deg[0] == 90 && query.view_zenith_deg[1] == 0 && query.view_zenith_deg[2] == 45);
	assert_int_equal(query.azimuth_count, 1);
	assert_true(query.relative_azimuth_deg[0] == -360);
	assert_int_equal(query.phase, SLAB_PHASE_MODIFIED);
	assert_int_equal(query.method, SLAB_BY_PHOTONS);
	assert_true(query.photons == 1e6 && query.seed == 4294967295);
	assert_true(query.input.scene.dsd.gamma == 5 && query.input.scene.model.optics == OPTICS_PAPER);
}

static void test_defaults(void **state)
{
	(void)state;
	read("optical_thickness=8");
	assert_int_equal(problem.kind, PROBLEM_NONE);
	assert_true(query.sun_zenith_deg == 55 && query.view_count == 6 && query.azimuth_count == 5);
	assert_int_equal(query.phase, SLAB_PHASE_FULL);
	assert_int_equal(query.method, SLAB_BY_SOLVER);
	read("optical_thickness=8&shading=paper");
	assert_int_equal(query.phase, SLAB_PHASE_MODIFIED);
	read("optical_thickness=20000&shading=montecarlo");
	assert_int_equal(problem.kind, PROBLEM_NONE);
	assert_true(query.photons >= 1000 && query.photons < 100000);
}

static char *canonical_of(const char *text)
{
	read(text);
	assert_int_equal(problem.kind, PROBLEM_NONE);
	char *canonical = slab_query_canonical(&query);
	assert_non_null(canonical);
	return canonical;
}

static void test_canonical(void **state)
{
	(void)state;
	static const char *const different[] = {
		"optical_thickness=8",
		"optical_thickness=8.000000001",
		"thickness_m=8",
		"optical_thickness=8&shading=paper",
		"optical_thickness=8&orders=modified",
		"optical_thickness=8&shading=montecarlo",
		"optical_thickness=8&shading=montecarlo&seed=2",
		"optical_thickness=8&shading=montecarlo&photons=5",
		"optical_thickness=8&view_zenith_deg=0",
		"optical_thickness=8&view_zenith_deg=0,0",
		"optical_thickness=8&relative_azimuth_deg=0",
		"optical_thickness=8&sun_zenith_deg=54",
		"optical_thickness=8&dsd.gamma=3",
		"optical_thickness=8&model.optics=paper",
	};
	enum { COUNT = sizeof different / sizeof *different };
	char *canonical[COUNT];
	for (int i = 0; i < COUNT; i++) {
		canonical[i] = canonical_of(different[i]);
		for (int j = 0; j < i; j++)
			assert_string_not_equal(canonical[i], canonical[j]);
	}
	char *same =
		canonical_of("dsd.gamma=2.0&orders=full&relative_azimuth_deg=0,4.5e1,90,135,180&optical_thickness=0.8e1&sun_zenith_deg=55");
	assert_string_equal(same, canonical[0]);
	free(same);
	for (int i = 0; i < COUNT; i++)
		free(canonical[i]);
}

/* --- anything at all --------------------------------------------------------------------------------------------------------------- */

static uint32_t random_below(uint32_t count)
{
	static uint64_t state = 11;
	state = state * 6364136223846793005ULL + 1442695040888963407ULL;
	return (uint32_t)((state >> 33) % count);
}

/* Members with values that are right, nearly right and wrong. */
static void random_text(char *text, size_t size)
{
	static const char *const names[] = {
		"optical_thickness", "thickness_m", "sun_zenith_deg", "view_zenith_deg", "relative_azimuth_deg", "orders", "shading",
		"photons",           "seed",        "dsd.gamma",      "model.optics",    "dsd.n0_per_cm3",       "x"};
	static const char *const values[] = {"1",     "8",      "0",     "90",         "-1",         "1e4",      "20001",  "0.5",
					     "1e400", "solved", "paper", "full",       "montecarlo", "modified", "",       ",",
					     "1,2",   "1,,2",   "nan",   "4294967296", "mie",        "%31",      "1e-300", "0,0,0,0"};
	text[0] = '\0';
	for (uint32_t i = random_below(6); i < 6; i++) {
		size_t used = strlen(text);
		snprintf(text + used, size - used, "&%s=%s", names[random_below(sizeof names / sizeof *names)],
			 values[random_below(sizeof values / sizeof *values)]);
	}
}

static void assert_query_sound(void)
{
	assert_true(query.optical_thickness >= 0 && query.optical_thickness <= 20000);
	assert_true(query.thickness_m >= 0 && query.thickness_m <= 10000);
	assert_true((query.optical_thickness > 0) != (query.thickness_m > 0));
	assert_true(query.sun_zenith_deg >= 0 && query.sun_zenith_deg <= 90);
	for (int i = 0; i < query.view_count; i++)
		assert_true(query.view_zenith_deg[i] >= 0 && query.view_zenith_deg[i] <= 90);
	for (int i = 0; i < query.azimuth_count; i++)
		assert_true(fabs(query.relative_azimuth_deg[i]) <= 360);
	assert_true(query.view_count >= 1 && query.azimuth_count >= 1);
	assert_true(query.photons >= 1 && query.photons <= 1e7 && query.photons == floor(query.photons));
	assert_true(query.seed >= 0 && query.seed <= 4294967295 && query.seed == floor(query.seed));
	assert_true(query.method != SLAB_BY_PAPER || query.phase == SLAB_PHASE_MODIFIED);
}

static void test_anything(void **state)
{
	(void)state;
	int good = 0;
	for (int i = 0; i < 200000; i++) {
		char text[512];
		random_text(text, sizeof text);
		read(text);
		if (problem.kind != PROBLEM_NONE)
			continue;
		good++;
		assert_query_sound();
	}
	assert_true(good > 500);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_teardown(test_everything_given, forget),
		cmocka_unit_test_teardown(test_defaults, forget),
		cmocka_unit_test_teardown(test_canonical, forget),
		cmocka_unit_test_teardown(test_anything, forget),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
