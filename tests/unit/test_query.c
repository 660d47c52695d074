/* Queries: splitting, decoding, and the same errors as a body's. */
#include "server/query.h"
#include "server/scene_query.h"
#include "server/scene_rules.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static struct problem problem;
static struct scene_input input;

static void read(const char *text)
{
	struct query query;
	problem_finish(&problem);
	input = scene_input_default();
	if (query_parse(text, &query, &problem)) {
		scene_query_read(&query, NULL, &input, &problem);
		scene_rules_apply(&input, &problem);
	}
	query_finish(&query);
}

static int forget(void **state)
{
	(void)state;
	problem_finish(&problem);
	return 0;
}

static void assert_refused(const char *text, const char *pointer)
{
	read(text);
	assert_int_equal(problem.kind, PROBLEM_INVALID);
	assert_int_equal(problem.error_count, 1);
	assert_string_equal(problem.errors[0].pointer, pointer);
}

static void test_members(void **state)
{
	(void)state;
	read("sun.elevation_deg=30&dsd.gamma=7&camera.position_m=0,-5,2&radiosity.enabled=false&output.format=exr&output.layers=color,sky&"
	     "output.exposure_ev=auto&clouds.type=none");
	assert_int_equal(problem.kind, PROBLEM_NONE);
	assert_true(input.scene.sun.elevation_deg == 30 && input.scene.dsd.gamma == 7 && input.scene.camera.position_m[1] == -5);
	assert_false(input.scene.radiosity.enabled);
	assert_int_equal(input.scene.output.layers, 1u << LAYER_COLOR | 1u << LAYER_SKY);
	assert_int_equal(input.scene.clouds.type, CLOUD_NONE);
	read(NULL);
	assert_int_equal(problem.kind, PROBLEM_NONE);
	read("&&sun.azimuth_deg=1&");
	assert_int_equal(problem.kind, PROBLEM_NONE);
}

static void test_decoding(void **state)
{
	(void)state;
	read("sun%2eelevation_deg=%33%30&camera.position_m=0%2C0%2c3");
	assert_int_equal(problem.kind, PROBLEM_NONE);
	assert_true(input.scene.sun.elevation_deg == 30 && input.scene.camera.position_m[2] == 3);
	read("sun.time=2003-10-17T14:30:30+02:00&sun.latitude_deg=39&sun.longitude_deg=0");
	assert_int_equal(problem.kind, PROBLEM_NONE);
	static const char *const bad[] = {"a=%", "a=%4", "a=%zz", "%00=1", "a=%00", "a=%ff", "%c3%28=1"};
	for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
		read(bad[i]);
		assert_int_equal(problem.kind, PROBLEM_BAD_REQUEST);
	}
}

static void test_refusals(void **state)
{
	(void)state;
	assert_refused("sun.elevation_deg=30&sun.elevation_deg=30", "/sun/elevation_deg");
	assert_refused("sun.elevation_deg=95", "/sun/elevation_deg");
	assert_refused("sun.elevation_deg=", "/sun/elevation_deg");
	assert_refused("sun.elevation_deg", "/sun/elevation_deg");
	assert_refused("sun.elevation_deg=nan", "/sun/elevation_deg");
	assert_refused("sun.elevation_deg=1e999", "/sun/elevation_deg");
	assert_refused("sun.elevation_deg=0x10", "/sun/elevation_deg");
	assert_refused("sun=3", "/sun");
	assert_refused("sun.elevation_deg.x=3", "/sun/elevation_deg/x");
	assert_refused("utm_source=x", "/utm_source");
	assert_refused("a/b=x", "/a~1b");
	assert_refused("radiosity.enabled=1", "/radiosity/enabled");
	assert_refused("camera.position_m=0,0", "/camera/position_m");
	assert_refused("camera.position_m=0,0,x", "/camera/position_m/2");
	assert_refused("output.layers=", "/output/layers/0");
	assert_refused("clouds.seed=1.5", "/clouds/seed");
	assert_refused("model.shading=toon", "/model/shading");
}

static void test_none_taken(void **state)
{
	(void)state;
	problem_finish(&problem);
	assert_true(scene_query_refuse(NULL, &problem) && scene_query_refuse("", &problem) && scene_query_refuse("&", &problem));
	assert_false(scene_query_refuse("sun.elevation_deg=1&y", &problem));
	assert_int_equal(problem.kind, PROBLEM_INVALID);
	assert_int_equal(problem.error_count, 2);
	assert_string_equal(problem.errors[0].pointer, "/sun/elevation_deg");
	problem_finish(&problem);
	assert_false(scene_query_refuse("%", &problem));
	assert_int_equal(problem.kind, PROBLEM_BAD_REQUEST);
}

static void test_too_many(void **state)
{
	(void)state;
	char text[4 * QUERY_PAIRS_MAX + 8] = "";
	for (int i = 0; i <= QUERY_PAIRS_MAX; i++)
		strcpy(text + 4 * i, "a=1&");
	read(text);
	assert_int_equal(problem.kind, PROBLEM_BAD_REQUEST);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_members),    cmocka_unit_test(test_decoding), cmocka_unit_test(test_refusals),
		cmocka_unit_test(test_none_taken), cmocka_unit_test(test_too_many),
	};
	return cmocka_run_group_tests_name("query", tests, NULL, forget);
}
