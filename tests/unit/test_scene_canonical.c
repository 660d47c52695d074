/* The canonical form reads back as itself, and its query means the same scene: over random scenes. */
#include "server/json_document.h"
#include "server/number_text.h"
#include "server/query.h"
#include "server/scene_canonical.h"
#include "server/scene_json.h"
#include "server/scene_query.h"
#include "server/scene_rules.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static uint64_t random_state = 88172645463325252u;

static uint64_t random_bits(void)
{
	random_state ^= random_state << 13;
	random_state ^= random_state >> 7;
	return random_state ^= random_state << 17;
}

static double random_in(const struct field_range *range)
{
	double share = (double)(random_bits() >> 11) / 9007199254740992.0;
	double value = range->low + share * (range->high - range->low);
	/* Half of them short, as people write them. */
	return random_bits() & 1 ? value : fmax(range->low, fmin(range->high, round(value * 10) / 10));
}

/* A value for a field by its type, all choices of this release alike. */
static json_t *random_value(const struct scene_field *field)
{
	json_t *list = json_array();
	unsigned choice, count = 0;
	switch (field->type) {
	case FIELD_NUMBERS:
		for (int i = 0; i < field->count; i++)
			json_array_append_new(list, json_real(random_in(&field->range[i])));
		return list;
	case FIELD_CHOICES:
		json_array_append_new(list, json_string(field->choices[0]));
		for (int i = 1; field->choices[i]; i++)
			if (random_bits() % 8 == 0)
				json_array_append_new(list, json_string(field->choices[i]));
		return list;
	default:
		json_decref(list);
	}
	switch (field->type) {
	case FIELD_BOOLEAN:
		return json_boolean(random_bits() & 1);
	case FIELD_TIME:
		return json_string(random_bits() & 1 ? "2024-06-21T14:00:00.25+02:00" : "1999-12-31T23:59:59.9999Z");
	case FIELD_CHOICE:
		while (field->choices[count])
			count++;
		do
			choice = (unsigned)(random_bits() % count);
		while (field->choices_later >> choice & 1);
		return json_string(field->choices[choice]);
	case FIELD_INTEGER:
		return json_real(field->flags & FIELD_POWER_OF_TWO ? field->range[0].high : floor(random_in(&field->range[0])));
	case FIELD_ASSET:
		return json_string("some-map_1.png");
	case FIELD_SEED:
		return json_real(floor(random_in(&field->range[0])));
	case FIELD_NUMBER_OR_AUTO:
		return random_bits() & 1 ? json_string("auto") : json_real(random_in(&field->range[0]));
	default:
		return json_real(random_in(&field->range[0]));
	}
}

/* Members that most panoramas, or most other pictures, are refused with. */
static bool is_out_of_place(const struct scene_field *field, bool panorama)
{
	static const char *const of_perspectives[] = {"azimuth_deg", "elevation_deg", "roll_deg", "vertical_fov_deg", "height", NULL};
	if (strcmp(field->section, "camera") != 0 && strcmp(field->section, "output") != 0)
		return false;
	if (strcmp(field->name, "projection") == 0 || strcmp(field->name, "face") == 0)
		return !panorama;
	return panorama && name_index(of_perspectives, field->name) >= 0;
}

/* Whether a field is for scenes with a map, for those without, or for both. A hash is a query's no member, and so left out here. */
static bool suits(const struct scene_field *field, bool map)
{
	static const char *const procedural[] = {"type", "seed", "coverage", "albedo", NULL};
	const bool either = strcmp(field->section, "clouds") == 0 || strcmp(field->section, "ground") == 0;
	if (field->type == FIELD_HASH)
		return false;
	return field->type == FIELD_ASSET ? map : !(map && either && name_index(procedural, field->name) >= 0);
}

static bool is_sampling(const struct scene_field *field)
{
	static const char *const sampling[] = {"samples", "time_budget_ms", "seed", "partial", NULL};
	return strcmp(field->section, "model") == 0 && name_index(sampling, field->name) >= 0;
}

/* A random scene that obeys the rules across members; the others are thrown away. */
static bool random_scene(struct scene *scene)
{
	struct scene_input input = scene_input_default();
	struct problem problem = {0};
	const bool panorama = random_bits() & 1, map = random_bits() % 4 == 0, by_time = random_bits() & 1;
	for (const struct scene_field *field = scene_fields; field->section; field++) {
		const bool of_sun = strcmp(field->section, "sun") == 0,
			   is_angle = strstr(field->name, "elevation") || strstr(field->name, "azimuth");
		const bool left_out = of_sun ? is_angle == by_time : random_bits() % 3 == 0;
		if (field->flags & (FIELD_INPUT_ONLY | FIELD_LATER) || is_out_of_place(field, panorama) || !suits(field, map) || left_out)
			continue;
		if (is_sampling(field) && input.scene.model.name != MODEL_REFERENCE)
			continue;
		json_t *value = random_value(field);
		scene_json_read_field(field, value, "/x", &input, &problem);
		json_decref(value);
	}
	assert_int_equal(problem.kind, PROBLEM_NONE);
	scene_rules_apply(&input, &problem);
	bool valid = problem.kind == PROBLEM_NONE;
	problem_finish(&problem);
	*scene = input.scene;
	return valid;
}

static struct scene scene_of_text(const char *body)
{
	struct scene_input input = scene_input_default();
	struct problem problem = {0};
	char *text = strdup(body);
	json_t *root = json_document_parse(text, strlen(text), &problem);
	scene_json_read(root, &input, &problem);
	scene_rules_apply(&input, &problem);
	if (problem.kind != PROBLEM_NONE)
		fail_msg("%s: %s", body, problem.error_count ? problem.errors[0].pointer : problem.detail);
	json_decref(root);
	free(text);
	return input.scene;
}

static struct scene scene_of_query(const char *text)
{
	struct scene_input input = scene_input_default();
	struct problem problem = {0};
	struct query query;
	assert_true(query_parse(text, &query, &problem));
	scene_query_read(&query, NULL, &input, &problem);
	scene_rules_apply(&input, &problem);
	if (problem.kind != PROBLEM_NONE)
		fail_msg("%s: %s", text, problem.error_count ? problem.errors[0].pointer : problem.detail);
	query_finish(&query);
	return input.scene;
}

static void test_round_trips(void **state)
{
	(void)state;
	int tried = 0, projections[PROJECTION_COUNT] = {0}, faces = 0;
	for (int i = 0; i < 20000 && tried < 500; i++) {
		struct scene scene;
		if (!random_scene(&scene))
			continue;
		tried++;
		projections[scene.camera.projection]++;
		faces += scene.camera.face != FACE_ALL;
		char *first = scene_canonical(&scene), *query = scene_canonical_query(&scene);
		struct scene again = scene_of_text(first), twin = scene_of_query(query);
		char *second = scene_canonical(&again), *third = scene_canonical(&twin);
		assert_string_equal(first, second);
		assert_string_equal(first, third);
		free(first), free(query), free(second), free(third);
	}
	assert_int_equal(tried, 500);
	for (int i = 0; i < PROJECTION_COUNT; i++)
		assert_true(projections[i] > 10);
	assert_true(faces > 10);
}

/* Members without a meaning in a projection are in no form of its scenes; its own sizes are said only where they are others. */
static void test_panoramas(void **state)
{
	(void)state;
	static const struct {
		const char *body, *camera, *query;
		int width, height;
	} cases[] = {
		{"{\"camera\":{\"projection\":\"fisheye\"}}", "\"camera\":{\"position_m\":[0,0,2],\"projection\":\"fisheye\"},",
		 "camera.projection=fisheye", 1024, 1024},
		{"{\"camera\":{\"projection\":\"equirectangular\"},\"output\":{\"height\":256}}", "\"projection\":\"equirectangular\"},",
		 "camera.projection=equirectangular&output.width=512&output.height=256", 512, 256},
		{"{\"camera\":{\"projection\":\"cubemap\"},\"output\":{\"width\":512}}", "\"projection\":\"cubemap\"},",
		 "camera.projection=cubemap", 512, 3072},
		{"{\"camera\":{\"projection\":\"cubemap\",\"face\":\"+X\"}}", "\"projection\":\"cubemap\",\"face\":\"+X\"},",
		 "camera.projection=cubemap&camera.face=+X", 512, 512},
		{"{\"camera\":{\"projection\":\"cubemap\",\"face\":\"-Z\"},\"output\":{\"width\":64}}",
		 "\"projection\":\"cubemap\",\"face\":\"-Z\"},",
		 "camera.projection=cubemap&camera.face=-Z&output.width=64&output.height=64", 64, 64},
	};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		const struct scene scene = scene_of_text(cases[i].body), twin = scene_of_query(cases[i].query);
		char *canonical = scene_canonical(&scene), *query = scene_canonical_query(&scene), *again = scene_canonical(&twin);
		assert_int_equal(scene.output.width, cases[i].width);
		assert_int_equal(scene.output.height, cases[i].height);
		assert_non_null(strstr(canonical, cases[i].camera));
		assert_null(strstr(canonical, "roll_deg"));
		assert_string_equal(query, cases[i].query);
		assert_string_equal(canonical, again);
		free(canonical), free(query), free(again);
	}
}

static void test_default_form(void **state)
{
	(void)state;
	struct scene scene = scene_of_text("{}");
	char *canonical = scene_canonical(&scene), *query = scene_canonical_query(&scene);
	assert_string_equal(query, "");
	assert_string_equal(
		canonical,
		"{\"sun\":{\"elevation_deg\":35,\"azimuth_deg\":140},\"dsd\":{\"n0_per_cm3\":300,\"gamma\":2,\"effective_radius_um\":7},"
		"\"clouds\":{\"type\":\"stratocumulus\",\"seed\":1,\"time_s\":0,\"coverage\":0.7,\"base_m\":1200,\"thickness_m\":400,"
		"\"tile_m\":20000,\"resolution\":512,\"wind_mps\":[8,3]},\"ground\":{\"type\":\"country\",\"albedo_scale\":1},"
		"\"atmosphere\":{\"aerosol_optical_depth\":0.1,\"ozone_du\":300},\"camera\":{\"position_m\":[0,0,2],\"azimuth_deg\":140,"
		"\"elevation_deg\":20,\"roll_deg\":0,\"vertical_fov_deg\":60,\"projection\":\"perspective\"},\"radiosity\":{\"enabled\":"
		"true,"
		"\"tolerance\":0.001,\"max_passes\":64},\"model\":{\"name\":\"slab\",\"shading\":\"solved\",\"optics\":\"mie\"},"
		"\"output\":{\"width\":1024,\"height\":768,\"format\":\"png\",\"exposure_ev\":\"auto\",\"tone\":\"filmic\",\"layers\":["
		"\"color\"],"
		"\"exr_compression\":\"zip\",\"exr_type\":\"auto\",\"png_compression\":\"fast\",\"bits\":8}}");
	free(canonical), free(query);
}

/* Time and place stay, for they go into files; both forms of a scene mean the same one. */
static void test_time_and_place(void **state)
{
	(void)state;
	struct scene scene = scene_of_text("{\"sun\":{\"time\":\"2024-06-21T14:00:00.25+02:00\",\"latitude_deg\":48,\"longitude_deg\":0}}");
	char *canonical = scene_canonical(&scene), *query = scene_canonical_query(&scene);
	assert_string_equal(query, "sun.time=2024-06-21T12:00:00.250Z&sun.latitude_deg=48&sun.longitude_deg=0");
	assert_memory_equal(canonical, "{\"sun\":{\"time\":\"2024-06-21T12:00:00.250Z\",\"latitude_deg\":48,\"longitude_deg\":0},\"dsd\"",
			    70);
	struct scene again = scene_of_text(canonical), twin = scene_of_query(query);
	assert_true(again.sun.elevation_deg == scene.sun.elevation_deg && twin.sun.elevation_deg == scene.sun.elevation_deg);
	assert_true(again.sun.azimuth_deg == scene.sun.azimuth_deg && twin.sun.azimuth_deg == scene.sun.azimuth_deg);
	free(canonical), free(query);
}

static void test_key(void **state)
{
	(void)state;
	char plain[DIGEST_SIZE], camera[DIGEST_SIZE], droplets[DIGEST_SIZE], air[DIGEST_SIZE];
	struct scene scene = scene_of_text("{}");
	scene_canonical_key(&scene, plain);
	scene = scene_of_text("{\"camera\":{\"azimuth_deg\":3},\"model\":{\"shading\":\"paper\"}}");
	scene_canonical_key(&scene, camera);
	scene = scene_of_text("{\"dsd\":{\"gamma\":3}}");
	scene_canonical_key(&scene, droplets);
	scene = scene_of_text("{\"atmosphere\":{\"ozone_du\":3}}");
	scene_canonical_key(&scene, air);
	assert_string_equal(plain, camera);
	assert_string_not_equal(plain, droplets);
	assert_string_not_equal(plain, air);
}

static void test_numbers(void **state)
{
	(void)state;
	static const struct {
		double value;
		const char *text;
	} cases[] = {{0, "0"},
		     {-0.0, "0"},
		     {1, "1"},
		     {-18, "-18"},
		     {0.1, "0.1"},
		     {1e7, "10000000"},
		     {4294967295.0, "4294967295"},
		     {1e-6, "0.000001"},
		     {1e-7, "1e-7"},
		     {1.5e-7, "1.5e-7"},
		     {1e21, "1e21"},
		     {1e20, "100000000000000000000"},
		     {123.456, "123.456"},
		     {1.0 / 3, "0.3333333333333333"},
		     {-1e6, "-1000000"},
		     {0.30000000000000004, "0.30000000000000004"}};
	char text[NUMBER_TEXT_SIZE];
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		number_format(cases[i].value, text);
		assert_string_equal(text, cases[i].text);
	}
	for (int i = 0; i < 20000; i++) {
		union {
			uint64_t bits;
			double value;
		} number = {.bits = random_bits()};
		double back;
		if (!isfinite(number.value))
			continue;
		number_format(number.value, text);
		assert_true(number_parse(text, &back));
		assert_true(back == number.value);
	}
	static const char *const bad[] = {"", "-", "+1", "01", "1.", ".5", "1e", "0x10", "nan", "inf", "1 ", " 1", "1e999", "1,2"};
	double ignored;
	for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
		assert_false(number_parse(bad[i], &ignored));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_round_trips),    cmocka_unit_test(test_panoramas), cmocka_unit_test(test_default_form),
		cmocka_unit_test(test_time_and_place), cmocka_unit_test(test_key),       cmocka_unit_test(test_numbers),
	};
	return cmocka_run_group_tests_name("scene_canonical", tests, NULL, NULL);
}
