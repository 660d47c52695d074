/* Scenes out of JSON: what is accepted, and every way to be refused. */
#include "server/json_document.h"
#include "server/scene_json.h"
#include "server/scene_rules.h"

#include "renderer/embed.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static struct problem problem;
static struct scene_input input;

/* Reads a body as the service does; `problem` and `input` hold the outcome. */
static void read(const char *body)
{
	problem_finish(&problem);
	input = scene_input_default();
	char *text = strdup(body);
	json_t *root = json_document_parse(text, strlen(text), &problem);
	if (root) {
		scene_json_read(root, &input, &problem);
		scene_rules_apply(&input, &problem);
	}
	json_decref(root);
	free(text);
}

static int forget(void **state)
{
	(void)state;
	problem_finish(&problem);
	return 0;
}

static void assert_valid(const char *body)
{
	read(body);
	if (problem.kind != PROBLEM_NONE)
		fail_msg("%s: %s %s", body, problem.error_count ? problem.errors[0].pointer : "",
			 problem.error_count ? problem.errors[0].detail : problem.detail);
}

/* Exactly one error, at the pointer. */
static void assert_refused(const char *body, const char *pointer)
{
	read(body);
	if (problem.kind != PROBLEM_INVALID || problem.error_count != 1)
		fail_msg("%s: %zu errors, kind %d, first %s", body, problem.error_count, problem.kind,
			 problem.error_count ? problem.errors[0].pointer : "-");
	assert_string_equal(problem.errors[0].pointer, pointer);
}

static void test_defaults(void **state)
{
	(void)state;
	assert_valid("{}");
	struct scene expected = scene_default();
	assert_memory_equal(&input.scene, &expected, sizeof expected);
}

static void test_members(void **state)
{
	(void)state;
	assert_valid("{\"clouds\":{\"seed\":4294967295,\"wind_mps\":[-100,100],\"resolution\":64},\"output\":{\"exposure_ev\":-3.5,"
		     "\"format\":\"exr\",\"layers\":[\"sky\",\"color\"]},\"radiosity\":{\"enabled\":false}}");
	assert_int_equal(input.scene.clouds.seed, 4294967295u);
	assert_true(input.scene.clouds.wind_mps[0] == -100 && input.scene.clouds.wind_mps[1] == 100);
	assert_false(input.scene.output.exposure_auto);
	assert_true(input.scene.output.exposure_ev == -3.5);
	assert_int_equal(input.scene.output.layers, 1u << LAYER_COLOR | 1u << LAYER_SKY);
	assert_false(input.scene.radiosity.enabled);
	assert_valid("{\"sun\":{\"elevation_deg\":3.5e1}}");
}

static void test_wrong_members(void **state)
{
	(void)state;
	assert_refused("[]", "");
	assert_refused("3", "");
	assert_refused("{\"moon\":{}}", "/moon");
	assert_refused("{\"sun\":{\"a/b~c\":1}}", "/sun/a~1b~0c");
	assert_refused("{\"sun\":4}", "/sun");
	assert_refused("{\"sun\":null}", "/sun");
	assert_refused("{\"sun\":{\"elevation_deg\":\"35\"}}", "/sun/elevation_deg");
	assert_refused("{\"sun\":{\"elevation_deg\":true}}", "/sun/elevation_deg");
	assert_refused("{\"radiosity\":{\"enabled\":1}}", "/radiosity/enabled");
	assert_refused("{\"clouds\":{\"seed\":1.5}}", "/clouds/seed");
	assert_refused("{\"clouds\":{\"seed\":-1}}", "/clouds/seed");
	assert_refused("{\"clouds\":{\"seed\":4294967296}}", "/clouds/seed");
	assert_refused("{\"clouds\":{\"resolution\":96}}", "/clouds/resolution");
	assert_refused("{\"clouds\":{\"wind_mps\":[1]}}", "/clouds/wind_mps");
	assert_refused("{\"clouds\":{\"wind_mps\":[1,101]}}", "/clouds/wind_mps/1");
	assert_refused("{\"clouds\":{\"type\":\"fog\"}}", "/clouds/type");
	assert_refused("{\"output\":{\"layers\":[]}}", "/output/layers");
	assert_refused("{\"output\":{\"format\":\"exr\",\"layers\":[\"sky\",\"sky\"]}}", "/output/layers/1");
	assert_refused("{\"output\":{\"exposure_ev\":\"bright\"}}", "/output/exposure_ev");
	assert_refused("{\"output\":{\"bits\":12}}", "/output/bits");
}

static void test_repeated_and_huge(void **state)
{
	(void)state;
	assert_refused("{\"sun\":{},\"sun\":{}}", "/sun");
	assert_refused("{\"sun\":{\"azimuth_deg\":1,\"azimuth_\\u0064eg\":2}}", "/sun/azimuth_deg");
	assert_refused("{\"sun\":{\"azimuth_deg\":1e999}}", "/sun/azimuth_deg");
	assert_refused("{\"camera\":{\"position_m\":[0,-1e400,2]}}", "/camera/position_m/1");
	read("{\"sun\":{\"azimuth_deg\":1e999,\"elevation_deg\":1e999},\"x\":1}");
	assert_int_equal(problem.error_count, 3);
	char digits[5000];
	memset(digits, '9', sizeof digits);
	memcpy(digits, "{\"dsd\":{\"gamma\":", 16);
	memcpy(digits + sizeof digits - 3, "}}", 3);
	assert_refused(digits, "/dsd/gamma");
}

static void test_all_at_once(void **state)
{
	(void)state;
	read("{\"sun\":{\"elevation_deg\":91},\"dsd\":{\"gamma\":0},\"ground\":{\"albedo\":[1,1,1]},\"output\":{\"width\":8},\"nothing\":"
	     "0}");
	assert_int_equal(problem.error_count, 5);
}

static void test_across_members(void **state)
{
	(void)state;
	assert_refused("{\"dsd\":{\"effective_radius_um\":7,\"characteristic_radius_um\":1}}", "/dsd/effective_radius_um");
	assert_valid("{\"dsd\":{\"characteristic_radius_um\":2,\"gamma\":3}}");
	assert_true(input.scene.dsd.effective_radius_um == 10);
	assert_refused("{\"dsd\":{\"characteristic_radius_um\":9,\"gamma\":3}}", "/dsd/characteristic_radius_um");
	assert_refused("{\"dsd\":{\"n0_per_cm3\":5000,\"effective_radius_um\":25}}", "/dsd");
	assert_refused("{\"ground\":{\"albedo\":[0,0,0]}}", "/ground/albedo");
	assert_refused("{\"ground\":{\"type\":\"lambert\",\"albedo\":[0.6,0,0],\"albedo_scale\":2}}", "/ground/albedo_scale");
	assert_valid("{\"ground\":{\"type\":\"lambert\",\"albedo\":[0.5,0,0],\"albedo_scale\":2}}");
	assert_refused("{\"camera\":{\"position_m\":[0,0,1400]}}", "/camera/position_m/2");
	assert_refused("{\"camera\":{\"position_m\":[0,0,1600]}}", "/camera/position_m/2");
	assert_valid("{\"camera\":{\"position_m\":[0,0,1601]}}");
	assert_valid("{\"camera\":{\"position_m\":[0,0,1400]},\"clouds\":{\"type\":\"none\"}}");
	assert_refused("{\"output\":{\"layers\":[\"sky\"]}}", "/output/layers");
	assert_valid("{\"output\":{\"width\":8192,\"height\":8192}}");
	assert_refused("{\"output\":{\"width\":8192,\"height\":8192,\"format\":\"exr\",\"layers\":[\"sky\",\"air\"]}}", "/output");
}

static void assert_size(const char *body, int width, int height)
{
	assert_valid(body);
	assert_int_equal(input.scene.output.width, width);
	assert_int_equal(input.scene.output.height, height);
}

static void test_panoramas(void **state)
{
	(void)state;
	assert_refused("{\"camera\":{\"projection\":\"fisheye\",\"roll_deg\":0}}", "/camera/roll_deg");
	read("{\"camera\":{\"projection\":\"cubemap\",\"azimuth_deg\":0,\"elevation_deg\":0,\"roll_deg\":0,\"vertical_fov_deg\":60}}");
	assert_int_equal(problem.error_count, 4);
	assert_refused("{\"camera\":{\"projection\":\"mercator\"}}", "/camera/projection");
	assert_refused("{\"camera\":{\"projection\":\"cubemap\",\"face\":\"X\"}}", "/camera/face");
	assert_refused("{\"camera\":{\"projection\":\"equirectangular\",\"face\":\"+X\"}}", "/camera/face");
	assert_refused("{\"camera\":{\"face\":\"+X\"}}", "/camera/face");

	assert_size("{\"camera\":{\"projection\":\"fisheye\"}}", 1024, 1024);
	assert_size("{\"camera\":{\"projection\":\"fisheye\"},\"output\":{\"height\":17}}", 17, 17);
	assert_size("{\"camera\":{\"projection\":\"equirectangular\"}}", 2048, 1024);
	assert_size("{\"camera\":{\"projection\":\"equirectangular\"},\"output\":{\"width\":1000}}", 1000, 500);
	assert_size("{\"camera\":{\"projection\":\"equirectangular\"},\"output\":{\"height\":4096}}", 8192, 4096);
	assert_size("{\"camera\":{\"projection\":\"equirectangular\"},\"output\":{\"width\":32,\"height\":16}}", 32, 16);
	assert_size("{\"camera\":{\"projection\":\"cubemap\"}}", 512, 3072);
	assert_size("{\"camera\":{\"projection\":\"cubemap\"},\"output\":{\"width\":1365}}", 1365, 8190);
	assert_size("{\"camera\":{\"projection\":\"cubemap\"},\"output\":{\"height\":96}}", 16, 96);
	assert_size("{\"camera\":{\"projection\":\"cubemap\",\"face\":\"-Y\"}}", 512, 512);
	assert_size("{\"camera\":{\"projection\":\"cubemap\",\"face\":\"-Y\"},\"output\":{\"width\":8192}}", 8192, 8192);
	assert_int_equal(input.scene.camera.face, FACE_NEG_Y);

	assert_refused("{\"camera\":{\"projection\":\"fisheye\"},\"output\":{\"width\":64,\"height\":65}}", "/output/height");
	assert_refused("{\"camera\":{\"projection\":\"equirectangular\"},\"output\":{\"width\":1001}}", "/output/width");
	assert_refused("{\"camera\":{\"projection\":\"equirectangular\"},\"output\":{\"width\":30}}", "/output/width");
	assert_refused("{\"camera\":{\"projection\":\"equirectangular\"},\"output\":{\"height\":4097}}", "/output/height");
	assert_refused("{\"camera\":{\"projection\":\"equirectangular\"},\"output\":{\"width\":512,\"height\":512}}", "/output/height");
	assert_refused("{\"camera\":{\"projection\":\"cubemap\"},\"output\":{\"width\":1366}}", "/output/width");
	assert_refused("{\"camera\":{\"projection\":\"cubemap\"},\"output\":{\"height\":3000,\"width\":512}}", "/output/height");
	assert_refused("{\"camera\":{\"projection\":\"cubemap\"},\"output\":{\"height\":3001}}", "/output/height");
	assert_refused("{\"camera\":{\"projection\":\"cubemap\"},\"output\":{\"height\":8}}", "/output/height");
}

static void test_sun_by_time(void **state)
{
	(void)state;
	assert_valid("{\"sun\":{\"time\":\"2003-10-17T12:30:30-07:00\",\"latitude_deg\":39.742476,\"longitude_deg\":-105.1786}}");
	assert_true(input.scene.sun.azimuth_deg > 194.3 && input.scene.sun.azimuth_deg < 194.4);
	read("{\"sun\":{\"time\":\"2003-10-17T12:30:30-07:00\"}}");
	assert_int_equal(problem.error_count, 2);
	assert_refused("{\"sun\":{\"time\":\"2003-10-17\",\"latitude_deg\":0,\"longitude_deg\":0}}", "/sun/time");
	assert_refused("{\"sun\":{\"time\":\"2003-10-17T00:00:00Z\",\"latitude_deg\":0,\"longitude_deg\":0}}", "/sun/time");
	assert_refused("{\"sun\":{\"elevation_deg\":3,\"time\":\"2003-10-17T12:00:00Z\",\"latitude_deg\":0,\"longitude_deg\":0}}",
		       "/sun/elevation_deg");
}

static void assert_later(const char *body, const char *pointer)
{
	read(body);
	for (size_t i = 0; i < problem.error_count; i++)
		if (strcmp(problem.errors[i].pointer, pointer) == 0 && strstr(problem.errors[i].detail, "not available yet"))
			return;
	fail_msg("%s: %s is not refused for later", body, pointer);
}

static void test_later(void **state)
{
	(void)state;
	assert_valid("{\"ground\":{\"type\":\"grass\"}}");
	assert_valid("{\"ground\":{\"type\":\"soil\"}}");
	assert_valid("{\"ground\":{\"type\":\"sand\"}}");
	assert_later("{\"model\":{\"name\":\"volume\"}}", "/model/name");
}

static void test_reference(void **state)
{
	(void)state;
	assert_valid("{\"model\":{\"name\":\"reference\",\"samples\":65536,\"time_budget_ms\":600000,\"seed\":4294967295,\"partial\":true},"
		     "\"output\":{\"format\":\"exr\",\"layers\":[\"color\",\"standard_error\"]}}");
	assert_true(input.scene.model.samples == 65536 && input.scene.model.partial && input.scene.model.time_budget_ms == 600000);
	assert_int_equal(input.scene.model.seed, 4294967295u);
	/* What it has no use for may stand beside it, and makes no other scene. */
	assert_valid("{\"model\":{\"name\":\"reference\",\"shading\":\"paper\"},\"radiosity\":{\"enabled\":false,\"max_passes\":3}}");
	const struct scene beside = input.scene;
	assert_valid("{\"model\":{\"name\":\"reference\"}}");
	assert_memory_equal(&beside, &input.scene, sizeof beside);
	assert_true(input.scene.model.samples == 64 && input.scene.model.seed == 1 && !input.scene.model.partial);
	assert_refused("{\"model\":{\"samples\":64}}", "/model/samples");
	assert_refused("{\"model\":{\"name\":\"slab\",\"partial\":false}}", "/model/partial");
	assert_refused("{\"model\":{\"name\":\"reference\",\"samples\":0}}", "/model/samples");
	assert_refused("{\"output\":{\"format\":\"exr\",\"layers\":[\"standard_error\"]}}", "/output/layers");
	assert_refused("{\"model\":{\"name\":\"none\",\"samples\":64}}", "/model/name");
}

static void test_maps(void **state)
{
	(void)state;
	assert_valid("{\"clouds\":{\"map\":\"a.b-c_9\",\"map_hash\":\"0123456789abcdef0123456789abcdef\"},"
		     "\"ground\":{\"map\":\"a\",\"albedo_scale\":2}}");
	assert_string_equal(input.scene.clouds.map.name, "a.b-c_9");
	assert_string_equal(input.scene.clouds.map.hash, "0123456789abcdef0123456789abcdef");
	assert_string_equal(input.scene.ground.map.name, "a");
	assert_int_equal(input.scene.ground.type, GROUND_LAMBERT);
	static const char *const bad_names[] = {
		"\"\"",   "\".a\"",  "\"a/b\"",
		"\"..\"", "\"a b\"", "\"\u00e4\"",
		"1",      "null",    "\"0123456789012345678901234567890123456789012345678901234567890123\""};
	for (size_t i = 0; i < sizeof bad_names / sizeof *bad_names; i++) {
		char body[128];
		snprintf(body, sizeof body, "{\"clouds\":{\"map\":%s}}", bad_names[i]);
		assert_refused(body, "/clouds/map");
	}
	assert_refused("{\"clouds\":{\"map\":\"a\",\"seed\":3}}", "/clouds/seed");
	assert_refused("{\"clouds\":{\"map\":\"a\",\"type\":\"none\"}}", "/clouds/type");
	assert_refused("{\"clouds\":{\"map\":\"a\",\"coverage\":0.5}}", "/clouds/coverage");
	assert_refused("{\"clouds\":{\"map\":\"a\",\"map_hash\":\"0123\"}}", "/clouds/map_hash");
	assert_refused("{\"clouds\":{\"map_hash\":\"0123456789abcdef0123456789abcdef\"}}", "/clouds/map_hash");
	assert_refused("{\"ground\":{\"map\":\"a\",\"type\":\"lambert\"}}", "/ground/type");
	assert_refused("{\"ground\":{\"map\":\"a\",\"albedo\":[0,0,0]}}", "/ground/albedo");
	assert_refused("{\"ground\":{\"map_hash\":\"0123456789abcdef0123456789abcdef\"}}", "/ground/map_hash");
}

static void test_not_json(void **state)
{
	(void)state;
	static const char *const bodies[] = {"",           "{",        "{\"a\":}",     "{'a':1}", "{\"a\":NaN}",        "{} {}",
					     "{\"a\":01}", "\"\xff\"", "{\"a\":1e999", "[1e999,", "{\"a\":\"\\u0000\"}"};
	for (size_t i = 0; i < sizeof bodies / sizeof *bodies; i++) {
		read(bodies[i]);
		assert_int_equal(problem.kind, PROBLEM_NOT_JSON);
		assert_non_null(strstr(problem.detail, "line 1, column"));
		char *json = problem_to_json(&problem, "id", 0);
		assert_non_null(json);
		free(json);
	}
}

/* Deep nesting, in what the parser takes and in what it refuses. */
static void test_nesting(void **state)
{
	(void)state;
	enum { DEEP = 200000 };
	char *bomb = malloc(DEEP + 64);
	memset(bomb, '[', DEEP);
	bomb[DEEP] = '\0';
	read(bomb);
	assert_int_equal(problem.kind, PROBLEM_NOT_JSON);
	memcpy(bomb, "[1e999,", 7);
	read(bomb);
	assert_int_equal(problem.kind, PROBLEM_NOT_JSON);
	memset(bomb + 5, '[', 1000);
	memcpy(bomb, "{\"a\":", 5);
	memset(bomb + 1005, ']', 1000);
	strcpy(bomb + 2005, "}");
	assert_refused(bomb, "/a");
	free(bomb);
}

/* Names and texts that nothing here is as long as are refused unread; one that does not end is no JSON. */
static void test_long_texts(void **state)
{
	(void)state;
	enum { LONG = JSON_DOCUMENT_TEXT_MAX };
	char *body = malloc(LONG + 64);
	for (int longer = 0; longer < 2; longer++) {
		const int length = LONG - 2 + longer;
		sprintf(body, "{\"%0*d\":1}", length, 0);
		read(body);
		assert_int_equal(problem.kind, PROBLEM_INVALID);
		assert_int_equal(problem.error_count, 1);
		assert_true((strstr(problem.errors[0].detail, "65536 bytes") != NULL) == (longer == 1));
	}
	memset(body, 'a', LONG + 32);
	memcpy(body, "{\"", 2);
	body[LONG + 32] = '\0';
	read(body);
	assert_int_equal(problem.kind, PROBLEM_NOT_JSON);
	free(body);
}

/* Many errors are counted, not all listed; long names are cut between characters. */
static void test_bounds_of_a_problem(void **state)
{
	(void)state;
	char body[40000] = "{";
	for (int i = 0; i < 1000; i++)
		sprintf(body + strlen(body), "\"unknown%d\":%d,", i, i);
	strcpy(body + strlen(body) - 1, "}");
	read(body);
	assert_int_equal(problem.error_count, 1000);
	char *json = problem_to_json(&problem, "id", 3);
	assert_non_null(strstr(json, "the first 64"));
	free(json);

	strcpy(body, "{\"");
	for (int i = 0; i < 5000; i++)
		strcat(body + 2 + 2 * i, "\xc3\xa9");
	strcat(body, "\":1}");
	read(body);
	json = problem_to_json(&problem, "id", 0);
	assert_non_null(json);
	free(json);
}

static void test_presets(void **state)
{
	(void)state;
	int count = 0;
	for (const struct embedded_file *file = resource_files; file->name; file++) {
		if (!strstr(file->name, "presets/"))
			continue;
		json_t *preset = json_loadb(file->data, file->size, JSON_REJECT_DUPLICATES, NULL);
		assert_non_null(preset);
		assert_true(json_is_string(json_object_get(preset, "title")) && json_is_string(json_object_get(preset, "description")));
		assert_int_equal(json_object_size(preset), 3);
		char *body = json_dumps(json_object_get(preset, "scene"), 0);
		assert_valid(body);
		free(body);
		json_decref(preset);
		count++;
	}
	assert_true(count >= 6);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_defaults),          cmocka_unit_test(test_members),     cmocka_unit_test(test_wrong_members),
		cmocka_unit_test(test_repeated_and_huge), cmocka_unit_test(test_all_at_once), cmocka_unit_test(test_across_members),
		cmocka_unit_test(test_panoramas),         cmocka_unit_test(test_sun_by_time), cmocka_unit_test(test_later),
		cmocka_unit_test(test_reference),         cmocka_unit_test(test_maps),        cmocka_unit_test(test_not_json),
		cmocka_unit_test(test_nesting),           cmocka_unit_test(test_long_texts),  cmocka_unit_test(test_bounds_of_a_problem),
		cmocka_unit_test(test_presets),
	};
	return cmocka_run_group_tests_name("scene_json", tests, NULL, forget);
}
