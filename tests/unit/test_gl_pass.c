/* Passes: what is bound while they run. Skipped where no OpenGL context comes up. */
#include "renderer/gl/context.h"
#include "renderer/gl/pass.h"
#include "renderer/gl/texture.h"
#include "renderer/log.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

static const struct pass_compiler compiler = {.kind = PASS_FRAGMENT};

/* Reads the first of its samplers alone, or none where it is the first octave. */
static struct pass *create(const char *defines)
{
	struct pass *pass = pass_create(&compiler, &(struct pass_desc){.file = "shaders/passes/field_octave.glsl",
								       .defines = defines,
								       .outputs = 1,
								       .samplers = {"coarser", "shape"}});
	assert_non_null(pass);
	return pass;
}

static bool run_lacks(const char *defines, const struct texture *coarser)
{
	struct texture target;
	struct pass *pass = create(defines);
	assert_true(texture_init(&target, 8, 8, TEXTURE_R32F, TEXTURE_NEAREST));
	pass_run(pass, &(struct pass_run){.targets = (struct texture *[]){&target}, .samplers = {coarser}, .arguments = {{8}}});
	const bool lacked = pass_lacked_texture();
	assert_false(pass_lacked_texture()); /* told once */
	texture_finish(&target);
	pass_destroy(pass);
	return lacked;
}

static void a_texture_that_is_read_and_was_not_given_is_told(void **state)
{
	struct texture coarser, nothing = {0};
	(void)state;
	assert_true(texture_init(&coarser, 4, 4, TEXTURE_R32F, TEXTURE_REPEAT));
	assert_false(run_lacks(NULL, &coarser));
	/* What the pass before left bound does not count. */
	assert_true(run_lacks(NULL, NULL));
	assert_true(run_lacks(NULL, &nothing));
	assert_false(run_lacks("#define OCTAVE_FIRST 1\n", NULL));
	texture_finish(&coarser);
}

int main(void)
{
	log_set_level(LOG_ERROR);
	struct gl_context *gl = gl_context_create(-1, false);
	if (!gl)
		return 77;
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_texture_that_is_read_and_was_not_given_is_told),
	};
	const int failed = cmocka_run_group_tests(tests, NULL, NULL);
	gl_context_destroy(gl);
	return failed;
}
