/* The golden render passes where the renderer is sound, and fails for stages that are not. */
#include "tests/unit/test_renderer_common.h"

#include "renderer/golden.h"

#include <unistd.h>

static void it_is_what_is_stored(void **state)
{
	(void)state;
	struct golden_picture first, second;
	assert_int_equal(golden_render(renderer, false, NULL, NULL, &first), GOLDEN_PASSED);
	assert_true(golden_compare(&first, &golden_expected));
	assert_int_equal(golden_render(renderer, true, NULL, NULL, &second), GOLDEN_PASSED);
	assert_true(golden_compare(&second, &first));
}

static bool at_once(void *context)
{
	(void)context;
	return true;
}

static void it_makes_way(void **state)
{
	(void)state;
	struct golden_picture picture;
	assert_int_equal(golden_render(renderer, false, at_once, NULL, &picture), GOLDEN_CANCELLED);
}

/* Wherever it is. */
static void one_wrong_block_is_enough(void **state)
{
	(void)state;
	static const struct golden_picture black;
	assert_false(golden_compare(&black, &golden_expected));
	for (int i = 0; i < GOLDEN_ROWS * GOLDEN_COLUMNS * 3; i += 23) {
		struct golden_picture wrong = golden_expected;
		(&wrong.mean[0][0][0])[i] += 6;
		assert_false(golden_compare(&wrong, &golden_expected));
		(&wrong.mean[0][0][0])[i] = NAN;
		assert_false(golden_compare(&wrong, &golden_expected));
	}
}

/* A copy of the shaders in which one thing is wrong; true: the golden render finds it. */
static bool finds(const char *file, const char *from, const char *to)
{
	char folder[] = "/tmp/stratus-golden-XXXXXX", command[1024];
	assert_non_null(mkdtemp(folder));
	snprintf(command, sizeof command, "cp -r shaders/. %s && grep -qF '%s' %s/%s && sed -i 's/%s/%s/' %s/%s", folder, from, folder,
		 file, from, to, folder, file);
	assert_int_equal(system(command), 0);
	const struct renderer_params params = {.device_index = -1, .pass_kind = PASS_FRAGMENT, .droplets = droplets, .shader_dir = folder};
	renderer_destroy(renderer);
	renderer = renderer_create(&params);
	assert_non_null(renderer);
	struct golden_picture picture;
	const bool found =
		golden_render(renderer, false, NULL, NULL, &picture) != GOLDEN_PASSED || !golden_compare(&picture, &golden_expected);
	snprintf(command, sizeof command, "rm -r %s", folder);
	assert_int_equal(system(command), 0);
	return found;
}

static void broken_shaders_are_found(void **state)
{
	(void)state;
	assert_false(finds("passes/develop.glsl", "exp2(develop.y)", "exp2(develop.y + 0.0)")); /* nothing is wrong here */
	assert_true(finds("passes/develop.glsl", "exp2(develop.y)", "exp2(develop.y + 0.3)"));
	assert_true(finds("passes/sky_view.glsl", "STORE(0, vec4(light.radiance, 1.0))", "STORE(0, vec4(0.0))"));
	assert_true(finds("passes/field_octave.glsl", "STORE(0, value)", "STORE(0, vec4(0.5))"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(it_is_what_is_stored),
		cmocka_unit_test(it_makes_way),
		cmocka_unit_test(one_wrong_block_is_enough),
		cmocka_unit_test(broken_shaders_are_found),
	};
	return RUN_WITH_RENDERER(tests);
}
