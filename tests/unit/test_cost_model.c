/* What pictures are predicted to cost, after others did cost what the test says. */
#include "server/cost_model.h"

#include "server/clock.h"
#include "server/line_fit.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static void a_line_is_found(void **state)
{
	(void)state;
	struct line_fit fit = {0};
	assert_true(line_fit_at(&fit, 2) == 0);
	static const double sizes[] = {0.1, 2, 0.5, 8, 0.3, 1};
	for (int i = 0; i < 60; i++)
		line_fit_add(&fit, sizes[i % 6], 12 + 150 * sizes[i % 6], 0);
	for (int i = 0; i < 6; i++)
		assert_float_equal(line_fit_at(&fit, sizes[i]), 12 + 150 * sizes[i], 0.01);
}

/* Of one size alone only the proportion is known; what falls with size is a mean. */
static void a_line_from_little(void **state)
{
	(void)state;
	struct line_fit one = {0}, falling = {0};
	for (int i = 0; i < 5; i++)
		line_fit_add(&one, 0.5, 100, 0);
	assert_float_equal(line_fit_at(&one, 1), 200, 1e-6);
	line_fit_add(&falling, 1, 100, 0);
	line_fit_add(&falling, 10, 80, 0);
	assert_true(line_fit_at(&falling, 10) >= 80 && line_fit_at(&falling, 10) <= 110);
	assert_true(line_fit_at(&falling, 1000) > 0);
}

static void odd_values_move_little(void **state)
{
	(void)state;
	struct line_fit fit = {0};
	for (int i = 0; i < 30; i++)
		line_fit_add(&fit, 1, 100, 0);
	line_fit_add(&fit, 1, 1e6, 0);
	assert_true(line_fit_at(&fit, 1) < 135);
	/* What stays is believed: ten thousandfold after some dozens. */
	int count = 0;
	while (line_fit_at(&fit, 1) < 0.5e6 && count < 200) {
		line_fit_add(&fit, 1, 1e6, 0);
		count++;
	}
	assert_true(count < 100);
}

static struct render_job job_of(const struct scene *scene, double spent_ms)
{
	struct render_job job = {.scene = scene, .spent_ms = spent_ms};
	for (int i = 0; i < STAGE_COUNT; i++)
		job.frame.timing[i].reused = true;
	return job;
}

/* As before it is pushed. */
static void expect(struct cost_model *model, const struct scene *scene)
{
	int ranks[COST_PARTS];
	cost_model_expect(model, scene, ranks);
}

static struct scene scene_of(int width, int height)
{
	struct scene scene = scene_default();
	scene.output.width = width;
	scene.output.height = height;
	return scene;
}

static double render_ms(struct cost_model *model, const struct scene *scene)
{
	return cost_model_predict(model, scene, NULL, false).render_ms;
}

static void kinds_are_told_apart(void **state)
{
	(void)state;
	struct cost_model *model = cost_model_create();
	cost_model_start(model, true);
	struct scene small = scene_of(400, 250), large = scene_of(2000, 1000), above = scene_of(1000, 1000), clear = scene_of(1000, 1000);
	above.camera.position_m[2] = 5000;
	clear.clouds.type = CLOUD_NONE;
	const struct scene *known[] = {&small, &above, &clear};
	for (int i = 0; i < 3; i++)
		expect(model, known[i]);
	for (int i = 0; i < 20; i++) { /* 10 ms and 100 for each megapixel; above thrice that, clear a tenth */
		struct render_job jobs[] = {job_of(&small, 20), job_of(&large, 210), job_of(&above, 330), job_of(&clear, 11)};
		for (int j = 0; j < 4; j++)
			cost_model_learn(model, &jobs[j]);
	}
	const struct scene middle = scene_of(1000, 1000);
	assert_float_equal(render_ms(model, &middle), 110, 2);
	assert_float_equal(render_ms(model, &above), 330, 2);
	assert_float_equal(render_ms(model, &clear), 11, 1);
	assert_true(cost_model_predict(model, &middle, NULL, false).fresh);
	/* Of another form nothing was measured: a guess, and no reason to refuse. */
	struct scene layers = scene_of(1000, 1000);
	layers.output.format = IMAGE_EXR;
	const struct cost guess = cost_model_predict(model, &layers, NULL, false);
	assert_false(guess.fresh);
	assert_true(guess.render_ms > 10 && guess.render_ms < 400);
	cost_model_destroy(model);
}

static void render_seed(struct cost_model *model, uint32_t seed, bool reused)
{
	struct scene scene = scene_of(1000, 1000);
	scene.clouds.seed = seed;
	struct render_job job = job_of(&scene, reused ? 100 : 300);
	cost_model_expect(model, &scene, job.cost_ranks);
	job.frame.timing[STAGE_FIELD] = (struct stage_timing){.milliseconds = reused ? 0 : 150, .reused = reused};
	job.frame.timing[STAGE_RADIOSITY] = (struct stage_timing){.milliseconds = reused ? 0 : 50, .reused = reused};
	cost_model_learn(model, &job);
}

static double seed_ms(struct cost_model *model, uint32_t seed)
{
	struct scene scene = scene_of(1000, 1000);
	scene.clouds.seed = seed;
	return render_ms(model, &scene);
}

/* What frames share counts once: for the first that asks for it. */
static void shared_parts_count_once(void **state)
{
	(void)state;
	struct cost_model *model = cost_model_create();
	struct scene scene = scene_of(1000, 1000);
	for (uint32_t seed = 0; seed < 10; seed++)
		render_seed(model, seed, false);
	assert_float_equal(seed_ms(model, 9), 100, 1);
	assert_float_equal(seed_ms(model, 77), 300, 1);
	scene.clouds.seed = 77;
	expect(model, &scene); /* one is on its way */
	assert_float_equal(render_ms(model, &scene), 100, 1);
	scene.camera.azimuth_deg = 10;
	assert_float_equal(render_ms(model, &scene), 100, 1);
	cost_model_destroy(model);
}

/* A scene of a field that nobody has asked for, of a type. */
static struct scene new_field(enum cloud_type type)
{
	static uint32_t seed = 1000;
	struct scene scene = scene_of(1000, 1000);
	scene.clouds.type = type;
	scene.clouds.seed = seed++;
	return scene;
}

static void render_field(struct cost_model *model, enum cloud_type type, double field_ms)
{
	const struct scene scene = new_field(type);
	struct render_job job = job_of(&scene, 100 + field_ms);
	job.frame.timing[STAGE_FIELD] = (struct stage_timing){.milliseconds = field_ms};
	expect(model, &scene);
	cost_model_learn(model, &job);
}

/* Of types that were not seen yet the mean of the others is a guess, and no reason to refuse. */
static void fields_are_told_apart_by_type(void **state)
{
	(void)state;
	struct cost_model *model = cost_model_create();
	for (int i = 0; i < 20; i++) {
		render_field(model, CLOUD_STRATUS, 50);
		render_field(model, CLOUD_ALTOCUMULUS, 150);
	}
	const struct scene stratus = new_field(CLOUD_STRATUS), altocumulus = new_field(CLOUD_ALTOCUMULUS),
			   other = new_field(CLOUD_CIRROCUMULUS);
	assert_float_equal(render_ms(model, &altocumulus) - render_ms(model, &stratus), 100, 2);
	assert_true(render_ms(model, &other) > render_ms(model, &stratus) + 20 &&
		    render_ms(model, &other) < render_ms(model, &altocumulus) - 20);
	assert_false(cost_model_predict(model, &other, NULL, false).fresh);
	cost_model_destroy(model);
}

/* How many of them the renderer keeps is learned from what it reused. */
static void the_memory_behind_is_learned(void **state)
{
	(void)state;
	struct cost_model *model = cost_model_create();
	for (int round = 0; round < 3; round++) /* eight in turn, all kept */
		for (uint32_t seed = 0; seed < 8; seed++)
			render_seed(model, seed, round > 0);
	assert_float_equal(seed_ms(model, 0), 100, 1);
	for (uint32_t seed = 0; seed < 8; seed++) /* none kept any more */
		render_seed(model, seed, false);
	assert_float_equal(seed_ms(model, 0), 300, 1);
	render_seed(model, 7, true);
	assert_float_equal(seed_ms(model, 7), 100, 1);
	cost_model_destroy(model);
}

static void droplets_and_encoding(void **state)
{
	(void)state;
	struct cost_model *model = cost_model_create();
	const struct scene scene = scene_of(1000, 1000);
	struct render_job job = job_of(&scene, 100);
	job.prepared = true;
	job.prepared_ms = 700;
	cost_model_learn(model, &job);
	cost_model_learn_encoding(model, &scene, 25);
	assert_float_equal(cost_model_predict(model, &scene, NULL, true).prepare_ms, 700, 1e-6);
	assert_true(cost_model_predict(model, &scene, NULL, false).prepare_ms == 0);
	assert_float_equal(cost_model_predict(model, &scene, NULL, false).encode_ms, 25, 1e-6);
	cost_model_destroy(model);
}

static void a_reference_counts_its_paths(void **state)
{
	(void)state;
	struct cost_model *model = cost_model_create();
	struct scene scene = scene_of(500, 400);
	scene.model.name = MODEL_REFERENCE;
	scene.model.samples = 16;
	struct render_job job = job_of(&scene, 1000);
	expect(model, &scene);
	job.frame.samples = 4; /* cut short: a quarter of the paths */
	cost_model_learn(model, &job);
	assert_float_equal(render_ms(model, &scene), 4000, 1);
	scene.model.time_budget_ms = 500;
	assert_float_equal(render_ms(model, &scene), 500, 1);
	cost_model_destroy(model);
}

static void pace_follows_load(void **state)
{
	(void)state;
	struct cost_model *model = cost_model_create();
	const struct scene scene = scene_of(1000, 1000);
	assert_float_equal(cost_model_pace(model), 1, 1e-9);
	struct render_job slow = job_of(&scene, 200), wild = job_of(&scene, 1e9);
	slow.predicted_ms = 100;
	wild.predicted_ms = 1;
	for (int i = 0; i < 12; i++)
		cost_model_learn(model, &slow);
	assert_float_equal(cost_model_pace(model), 2, 0.1);
	for (int i = 0; i < 50; i++)
		cost_model_learn(model, &wild);
	assert_true(cost_model_pace(model) <= 4.01);
	cost_model_destroy(model);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_line_is_found),         cmocka_unit_test(a_line_from_little),
		cmocka_unit_test(odd_values_move_little),  cmocka_unit_test(kinds_are_told_apart),
		cmocka_unit_test(shared_parts_count_once), cmocka_unit_test(fields_are_told_apart_by_type),
		cmocka_unit_test(droplets_and_encoding),   cmocka_unit_test(the_memory_behind_is_learned),
		cmocka_unit_test(pace_follows_load),       cmocka_unit_test(a_reference_counts_its_paths),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
