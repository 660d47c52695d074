/* Accept, If-None-Match, Content-Type, Server-Timing: what the headers mean. */
#include "server/entity_tag.h"
#include "server/negotiation.h"
#include "server/server_timing.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

enum { NONE = -1 };

static int choose(const char *accept, enum image_format wanted)
{
	enum image_format chosen;
	return negotiation_choose(accept, wanted, &chosen) ? (int)chosen : NONE;
}

static void test_accept(void **state)
{
	(void)state;
	static const struct {
		const char *accept;
		int for_png, for_exr; /* what goes out when the scene asks for that */
	} cases[] = {
		{NULL, IMAGE_PNG, IMAGE_EXR},
		{"", IMAGE_PNG, IMAGE_EXR},
		{"*/*", IMAGE_PNG, IMAGE_EXR},
		{"image/*", IMAGE_PNG, IMAGE_EXR},
		{"image/png", IMAGE_PNG, IMAGE_PNG},
		{"image/x-exr", IMAGE_EXR, IMAGE_EXR},
		{"IMAGE/X-EXR", IMAGE_EXR, IMAGE_EXR},
		{"image/png, */*", IMAGE_PNG, IMAGE_PNG},
		{"image/png;q=0.5, */*", IMAGE_PNG, IMAGE_EXR},
		{"image/png, image/x-exr", IMAGE_PNG, IMAGE_EXR},
		{"image/png;q=0.2, image/x-exr;q=0.9", IMAGE_EXR, IMAGE_EXR},
		{"image/avif,image/webp,image/*,*/*;q=0.8", IMAGE_PNG, IMAGE_EXR},
		{"image/png;q=0", NONE, NONE},
		{"image/png;q=0, */*", NONE, IMAGE_EXR},
		{"image/x-exr;q=0.0, image/*;q=0.1", IMAGE_PNG, NONE},
		{"text/html", NONE, NONE},
		{"*/*;q=0", NONE, NONE},
		{" image/png ; charset=x ; q=0.3 ", IMAGE_PNG, IMAGE_PNG},
		{"image/png;q=nonsense", NONE, NONE},
		{",,;,image/x-exr", IMAGE_EXR, IMAGE_EXR},
	};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		int png = choose(cases[i].accept, IMAGE_PNG), exr = choose(cases[i].accept, IMAGE_EXR);
		if (png != cases[i].for_png || exr != cases[i].for_exr)
			fail_msg("Accept: %s gives %d and %d", cases[i].accept, png, exr);
	}
}

static void test_choice_of_types(void **state)
{
	(void)state;
	static const char *const types[] = {"application/json", "image/png", "image/x-exr", NULL};
	static const struct {
		const char *accept;
		int chosen;
	} cases[] = {
		{NULL, 0},
		{"", 0},
		{"*/*", 0},
		{"application/*", 0},
		{"image/*", 1},
		{"image/x-exr", 2},
		{"image/x-exr, */*", 2},
		{"image/*, image/x-exr", 2},
		{"image/x-exr;q=0.3, */*", 0},
		{"image/png, application/json", 0},
		{"image/png;q=0.8, application/json;q=0.7", 1},
		{"application/json;q=0, image/*;q=0.1", 1},
		{"text/html", NONE},
		{"*/*;q=0", NONE},
		{"applicationx/*, image", NONE},
	};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
		if (negotiation_choose_type(cases[i].accept, types) != cases[i].chosen)
			fail_msg("Accept: %s gives %d", cases[i].accept, negotiation_choose_type(cases[i].accept, types));
}

static void test_content_type(void **state)
{
	(void)state;
	assert_true(negotiation_is_json(NULL));
	assert_true(negotiation_is_json("application/json"));
	assert_true(negotiation_is_json("Application/JSON; charset=utf-8"));
	assert_false(negotiation_is_json("application/jsonx"));
	assert_false(negotiation_is_json("text/plain"));
	assert_false(negotiation_is_json(""));
}

static void test_entity_tags(void **state)
{
	(void)state;
	char tag[ENTITY_TAG_SIZE], other[ENTITY_TAG_SIZE];
	entity_tag_of("abc", 3, tag);
	entity_tag_of("abd", 3, other);
	assert_string_equal(tag, "\"ba7816bf8f01cfea414140de5dae2223\"");
	assert_string_not_equal(tag, other);

	static const char one[] = "\"one\"";
	assert_false(entity_tag_matches(NULL, one));
	assert_false(entity_tag_matches("", one));
	assert_true(entity_tag_matches("*", one));
	assert_true(entity_tag_matches(" \"one\"", one));
	assert_true(entity_tag_matches("W/\"one\"", one));
	assert_true(entity_tag_matches("\"two\", W/\"three\" ,\"one\"", one));
	assert_true(entity_tag_matches("\"a,b\",\"one\"", one));
	assert_false(entity_tag_matches("\"two\"", one));
	assert_false(entity_tag_matches("one", one));
	assert_false(entity_tag_matches("\"one", one));
	assert_false(entity_tag_matches("\"oneone\"", one));
}

static void test_server_timing(void **state)
{
	(void)state;
	struct timings timings = {0};
	char text[SERVER_TIMING_SIZE];
	timings_format(&timings, text);
	assert_string_equal(text, "");

	struct frame frame = {.radiosity_passes = 8, .radiosity_residual = 0.0004};
	for (int i = 0; i < STAGE_COUNT; i++)
		frame.timing[i].milliseconds = i + 1;
	frame.timing[STAGE_SKY] = (struct stage_timing){.reused = true};
	timings_set(&timings, TIMING_QUEUE, 0.41);
	timings_set_frame(&timings, &frame);
	timings_set(&timings, TIMING_ENCODE, 9.6);
	timings_set(&timings, TIMING_TOTAL, 21.5);
	timings_format(&timings, text);
	assert_string_equal(text, "queue;dur=0.410, optics;dur=1.000, sky;desc=\"reused\";dur=0.000, field;dur=3.000, "
				  "radiosity;desc=\"8 passes, residual 0.0004\";dur=4.000, view;dur=5.000, readback;dur=6.000, "
				  "encode;dur=9.600, total;dur=21.500");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_accept),      cmocka_unit_test(test_choice_of_types), cmocka_unit_test(test_content_type),
		cmocka_unit_test(test_entity_tags), cmocka_unit_test(test_server_timing),
	};
	return cmocka_run_group_tests_name("negotiation", tests, NULL, NULL);
}
