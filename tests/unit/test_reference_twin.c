/* The reference model's shader against its twin on the processor, fed with copies of the textures that the stages made. Wants
 * build/mie.kernel, or the file that STRATUS_KERNEL names; skipped where there is no EGL. */
#include "renderer/gl/context.h"
#include "renderer/log.h"
#include "renderer/optics/kernel.h"
#include "renderer/stages/reference.h"
#include "tests/twin/twin.h"

#include <epoxy/gl.h>

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <cmocka.h>

enum { WIDTH = 24, HEIGHT = 24, SAMPLES = 512, THREADS = 2, BLOCKS = 4, LAYERS = TWIN_LAYERS };

static const enum layer wanted[2 + LAYERS] = {LAYER_COLOR,     LAYER_STANDARD_ERROR, LAYER_ORDER1, LAYER_MULTIPLE,
					      LAYER_CLOUD_SKY, LAYER_CLOUD_GROUND,   LAYER_GROUND};

static struct gl_context *gl;
static struct kernel *kernel;
static struct droplet_store *store;

/* The stages that the reference model stands on. */
struct pipeline {
	struct stage_context context;
	struct ground_stage ground;
	struct sky_stage sky;
	struct field_stage field;
	struct radiosity_stage radiosity;
	struct reference_stage reference;
	/* What they made of a scene. */
	struct ground_maps ground_maps;
	struct sky_tables sky_tables, at_layer, at_ground;
	struct field_maps maps;
	struct radiosity_light light;
	struct view_inputs view;
};

static void pipeline_init(struct pipeline *pipeline, enum pass_kind kind)
{
	const struct pass_compiler compiler = {.kind = kind};
	*pipeline = (struct pipeline){0};
	pipeline->context.cache = cache_create(256u << 20);
	pipeline->context.droplets = store;
	glCreateBuffers(1, &pipeline->context.block_buffer);
	glNamedBufferStorage(pipeline->context.block_buffer, sizeof pipeline->context.block, NULL, GL_DYNAMIC_STORAGE_BIT);
	ground_stage_init(&pipeline->ground, &compiler);
	reference_stage_init(&pipeline->reference, &compiler);
	assert_true(sky_stage_init(&pipeline->sky, &compiler) && field_stage_init(&pipeline->field, &compiler) &&
		    radiosity_stage_init(&pipeline->radiosity, &compiler));
}

static void pipeline_finish(struct pipeline *pipeline)
{
	droplets_release(&pipeline->context);
	cache_destroy(pipeline->context.cache);
	reference_stage_finish(&pipeline->reference);
	radiosity_stage_finish(&pipeline->radiosity);
	field_stage_finish(&pipeline->field);
	sky_stage_finish(&pipeline->sky);
	ground_stage_finish(&pipeline->ground);
	glDeleteBuffers(1, &pipeline->context.block_buffer);
}

static void run_sky(struct pipeline *pipeline, const struct scene *scene, double height, struct sky_tables *tables)
{
	static const double albedo[3] = {0.3, 0.3, 0.25};
	struct scene there = *scene;
	there.camera.position_m[2] = height;
	pipeline->context.block.camera_position[2] = (float)height;
	assert_true(sky_stage_run(&pipeline->sky, &pipeline->context, &there, albedo, tables));
}

static void run_stages(struct pipeline *pipeline, const struct scene *scene)
{
	struct stage_context *context = &pipeline->context;
	const double height = scene->camera.position_m[2];
	const struct texture *slab_rows, *slices;
	cache_begin_frame(context->cache);
	view_fill_block(&context->block, scene);
	context->block.cloud_layer[0] = (float)scene->clouds.base_m;
	context->block.cloud_layer[1] = (float)scene->clouds.thickness_m;
	context->block.cloud_layer[3] = 1;
	const struct droplets *droplets = droplets_get(context, scene);
	assert_non_null(droplets);
	assert_non_null(slab_rows = slab_rows_get(context, scene, droplets));
	assert_true(slab_slices_get(context, scene, droplets, &slices));
	assert_true(ground_stage_run(&pipeline->ground, context, scene, &pipeline->ground_maps));
	run_sky(pipeline, scene, scene->clouds.base_m + scene->clouds.thickness_m, &pipeline->at_layer);
	run_sky(pipeline, scene, 0.1, &pipeline->at_ground);
	run_sky(pipeline, scene, height, &pipeline->sky_tables);
	assert_true(field_stage_run(&pipeline->field, context, scene, field_uses(scene), &pipeline->maps));
	assert_true(radiosity_stage_run(&pipeline->radiosity, context, scene, &pipeline->ground_maps, &pipeline->sky_tables,
					&pipeline->maps, slab_rows, &pipeline->light));
	stage_upload_block(context);
	pipeline->view = (struct view_inputs){.ground = &pipeline->ground_maps,
					      .droplets = droplets,
					      .sky = &pipeline->sky_tables,
					      .field = &pipeline->maps,
					      .light = &pipeline->light};
}

/* Values of a picture's layer, four a pixel. */
struct picture {
	float layer[2 + LAYERS][WIDTH * HEIGHT * 4];
};

static void render_by_shader(struct pipeline *pipeline, const struct scene *scene, struct picture *picture)
{
	const struct texture *textures[2 + LAYERS];
	struct reference_result result;
	const struct reference_inputs inputs = {&pipeline->view, pipeline->at_layer.total, pipeline->at_ground.total};
	const struct reference_watch nobody = {0};
	struct reference_work *work = NULL;
	assert_true(reference_stage_run(&pipeline->reference, &pipeline->context, scene, &inputs, wanted, 2 + LAYERS, &nobody, &work,
					textures, &result));
	assert_null(work);
	assert_int_equal(result.samples, scene->model.samples);
	for (int i = 0; i < 2 + LAYERS; i++)
		stage_read_texture(textures[i], 0, 4, picture->layer[i]);
	assert_false(gl_failed("rendering"));
}

static struct twin_texture copy_of(const struct texture *texture)
{
	GLint wrap, filter;
	glGetTextureParameteriv(texture->id, GL_TEXTURE_WRAP_S, &wrap);
	glGetTextureParameteriv(texture->id, GL_TEXTURE_MAG_FILTER, &filter);
	struct twin_texture copy = {.width = texture->width,
				    .height = texture->height,
				    .levels = texture->levels,
				    .repeat = wrap == GL_REPEAT,
				    .nearest = filter == GL_NEAREST};
	for (int level = 0; level < texture->levels; level++) {
		const size_t width = (size_t)(texture->width >> level ? texture->width >> level : 1);
		const size_t height = (size_t)(texture->height >> level ? texture->height >> level : 1);
		float *texels = malloc(width * height * 4 * sizeof *texels);
		assert_non_null(texels);
		stage_read_texture(texture, level, 4, texels);
		copy.level[level] = texels;
	}
	return copy;
}

static void twin_init(struct twin *twin, const struct pipeline *pipeline, const struct scene *scene)
{
	const struct sky_tables *sky = &pipeline->sky_tables;
	const struct reference_tables *tables = &pipeline->reference.tables;
	const struct texture *textures[TWIN_SAMPLER_COUNT] = {sky->transmittance,
							      sky->total,
							      sky->near,
							      sky->to_layer,
							      sky->to_end,
							      pipeline->ground_maps.map,
							      &pipeline->view.droplets->phase,
							      &tables->tops,
							      &tables->bounds,
							      &tables->inverse,
							      &tables->chains,
							      pipeline->at_layer.total,
							      pipeline->at_ground.total};
	*twin = (struct twin){.block = pipeline->context.block,
			      .above = scene->camera.position_m[2] > scene->clouds.base_m,
			      .seed = scene->model.seed,
			      .paths = SCENE_PATHS_ALL};
	for (int i = 0; i < TWIN_SAMPLER_COUNT; i++)
		twin->texture[i] = copy_of(textures[i]);
	for (int i = 0; i < LAYERS; i++)
		twin->layer[i] = (int)wanted[2 + i];
}

static void twin_finish(struct twin *twin)
{
	for (int i = 0; i < TWIN_SAMPLER_COUNT; i++)
		for (int level = 0; level < twin->texture[i].levels; level++)
			free((void *)twin->texture[i].level[level]);
}

/* Other samples than the shader's, so that what both say is independent. chains: for as long as the twin. */
static void render_by_twin(struct twin *twin, const struct droplet_tables *tables, struct path_chains *chains, float *outputs[TWIN_OUTPUTS])
{
	twin->seed += 1;
	free((void *)twin->texture[TWIN_CHAINS].level[0]);
	twin->texture[TWIN_CHAINS].level[0] = &chains->chain[0][0][0][0][0];
	for (int first = 0; first < SAMPLES; first += 16) {
		path_chains_draw(chains, tables, twin->block.sun_direction[3], twin->seed, (uint64_t)first);
		twin_run(twin, WIDTH, HEIGHT, first, 16, THREADS, outputs);
	}
}

/* Mean over a part of the picture, and the standard error of it from the samples' scatter. */
struct mean {
	double value, error;
};

static struct mean shader_mean(const struct picture *picture, int first, int end)
{
	struct mean mean = {0, 0};
	for (int i = first; i < end; i++) {
		mean.value += picture->layer[0][4 * i + 1] / (end - first);
		mean.error += pow(picture->layer[1][4 * i + 1] / (end - first), 2);
	}
	mean.error = sqrt(mean.error);
	return mean;
}

static struct mean twin_mean(const float *color, const float *squares, int first, int end)
{
	struct mean mean = {0, 0};
	for (int i = first; i < end; i++) {
		const double value = color[4 * i + 1] / SAMPLES, variance = squares[4 * i + 1] / SAMPLES - value * value;
		mean.value += value / (end - first);
		mean.error += fmax(0, variance) / (SAMPLES - 1) / pow(end - first, 2);
	}
	mean.error = sqrt(mean.error);
	return mean;
}

static double layer_mean(const float *values, double scale)
{
	double sum = 0;
	for (int i = 0; i < WIDTH * HEIGHT; i++)
		sum += scale * values[4 * i + 1] / (WIDTH * HEIGHT);
	return sum;
}

static struct scene make_scene(int number)
{
	struct scene scene = scene_default();
	scene.model.name = MODEL_REFERENCE;
	scene.model.samples = SAMPLES;
	scene.output.width = WIDTH;
	scene.output.height = HEIGHT;
	scene.clouds.resolution = 128;
	scene.clouds.tile_m = 8000;
	scene.clouds.thickness_m = 250;
	scene.camera.azimuth_deg = 60;
	scene.ground.type = GROUND_SAND; /* the twin's ground is bare */
	scene.camera.elevation_deg = number == 0 ? 35 : -35;
	if (number > 0)
		scene.camera.position_m[2] = 3000;
	return scene;
}

/* In quarters of the picture and in layers: within 3 standard errors. */
static void shader_and_twin_agree(void **state)
{
	(void)state;
	for (int number = 0; number < 2; number++) {
		static struct picture picture;
		static float sums[TWIN_OUTPUTS][WIDTH * HEIGHT * 4];
		float *outputs[TWIN_OUTPUTS];
		const struct scene scene = make_scene(number);
		struct pipeline pipeline;
		struct twin twin;
		for (int i = 0; i < TWIN_OUTPUTS; i++) {
			outputs[i] = sums[i];
			for (int k = 0; k < WIDTH * HEIGHT * 4; k++)
				sums[i][k] = 0;
		}
		pipeline_init(&pipeline, PASS_FRAGMENT);
		run_stages(&pipeline, &scene);
		render_by_shader(&pipeline, &scene, &picture);
		twin_init(&twin, &pipeline, &scene);
		struct path_chains *chains = malloc(sizeof *chains);
		assert_non_null(chains);
		render_by_twin(&twin, pipeline.view.droplets->tables, chains, outputs);
		const int quarter = WIDTH * HEIGHT / BLOCKS;
		for (int i = 0; i <= BLOCKS; i++) {
			const int first = i < BLOCKS ? i * quarter : 0, end = i < BLOCKS ? first + quarter : WIDTH * HEIGHT;
			const struct mean a = shader_mean(&picture, first, end), b = twin_mean(sums[0], sums[2], first, end);
			const double error = hypot(a.error, b.error);
			print_message("scene %d, part %d: shader %.5f, twin %.5f, standard error %.2f %%\n", number, i, a.value, b.value,
				      100 * error / b.value);
			assert_true(error < (i < BLOCKS ? 0.05 : 0.01) * b.value);
			assert_true(fabs(a.value - b.value) < 3 * error);
		}
		for (int i = 2; i < 2 + LAYERS; i++) {
			const double a = layer_mean(picture.layer[i], 1), all = layer_mean(picture.layer[0], 1);
			/* The twin's are still in the bands. */
			const float *green = pipeline.context.block.band_green, *red = pipeline.context.block.band_red;
			const float *blue = pipeline.context.block.band_blue;
			double b = 0;
			for (int k = 0; k < WIDTH * HEIGHT; k++)
				b += (red[1] * sums[i + 1][4 * k] + green[1] * sums[i + 1][4 * k + 1] + blue[1] * sums[i + 1][4 * k + 2]) /
				     SAMPLES / (WIDTH * HEIGHT);
			print_message("scene %d, %s: shader %.5f, twin %.5f\n", number, scene_layer_names[wanted[i]], a, b);
			assert_true(fabs(a - b) < 0.025 * all);
		}
		twin.texture[TWIN_CHAINS].levels = 0;
		twin_finish(&twin);
		free(chains);
		pipeline_finish(&pipeline);
	}
}

/* As compute programs the same numbers come out, to the last digits. */
static void compute_shows_what_fragments_show(void **state)
{
	(void)state;
	static struct picture pictures[2];
	struct scene scene = make_scene(0);
	scene.model.samples = 8;
	for (int i = 0; i < 2; i++) {
		struct pipeline pipeline;
		pipeline_init(&pipeline, i == 0 ? PASS_FRAGMENT : PASS_COMPUTE);
		run_stages(&pipeline, &scene);
		render_by_shader(&pipeline, &scene, &pictures[i]);
		pipeline_finish(&pipeline);
	}
	const double a = layer_mean(pictures[0].layer[0], 1), b = layer_mean(pictures[1].layer[0], 1);
	print_message("fragments %.6f, compute %.6f\n", a, b);
	assert_true(fabs(a - b) < 0.02 * a);
}

int main(void)
{
	const char *path = getenv("STRATUS_KERNEL");
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(shader_and_twin_agree),
		cmocka_unit_test(compute_shows_what_fragments_show),
	};
	log_set_level(LOG_ERROR);
	gl = gl_context_create(-1, false);
	if (!gl)
		return 77;
	kernel = kernel_load(path ? path : "build/mie.kernel");
	store = kernel ? droplet_store_create(&(struct droplet_store_params){.kernel = kernel}) : NULL;
	const int failed = store ? cmocka_run_group_tests(tests, NULL, NULL) : 1;
	droplet_store_destroy(store);
	kernel_destroy(kernel);
	gl_context_destroy(gl);
	return failed;
}
