/* Pictures from OpenGL against the same pixels rendered by the processor: the library and the view pass compiled as C++, fed with copies
 * of the textures that the stages made; and fragment against compute programs. Wants build/mie.kernel, or the file that STRATUS_KERNEL
 * names; skipped where there is no EGL. */
extern "C" {
#include "renderer/gl/context.h"
#include "renderer/optics/kernel.h"
#include "renderer/stages/sea.h"
#include "renderer/stages/view.h"
}
#include "tests/unit/glsl_shim.h"

#include <epoxy/gl.h>

#include <cstdarg>
#include <csetjmp>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
extern "C" {
#include <cmocka.h>
}

enum { VARIANTS = 11, FIRST_GROUND = 7 };
static const char *const variant_names[VARIANTS] = {"clear",        "below",           "above",           "below, paper",
						    "above, paper", "below, twilight", "above, twilight", "below, bare",
						    "below, sea",   "below, sea ice",  "above, sea"};

/* The view pass, once for each side and shading. */
#define VIEW_REGION     0
#define VIEW_COLOR_ONLY 0
#define VIEW_CLOUDS     0
#define VIEW_ABOVE      0
#define VIEW_SOLVED     1
#define VIEW_TWILIGHT   1
#define VIEW_GROUND     1
namespace glsl
{
namespace clear
{
#include "shaders/passes/view.glsl"
} // namespace clear
#include "tests/unit/glsl_again.h"
#undef VIEW_CLOUDS
#define VIEW_CLOUDS  1
#define FIELD_PACKED 1
namespace below
{
#include "shaders/passes/view.glsl"
} // namespace below
#include "tests/unit/glsl_again.h"
#undef VIEW_SOLVED
#define VIEW_SOLVED 0
namespace below_paper
{
#include "shaders/passes/view.glsl"
} // namespace below_paper
#include "tests/unit/glsl_again.h"
#undef FIELD_PACKED
#undef VIEW_ABOVE
#define VIEW_ABOVE 1
namespace above_paper
{
#include "shaders/passes/view.glsl"
} // namespace above_paper
#include "tests/unit/glsl_again.h"
#undef VIEW_SOLVED
#define VIEW_SOLVED 1
namespace above
{
#include "shaders/passes/view.glsl"
} // namespace above
#include "tests/unit/glsl_again.h"
#define HEIGHT_NEAR 1
namespace height_start_pass
{
#include "shaders/passes/height_start.glsl"
} // namespace height_start_pass
#include "tests/unit/glsl_again.h"
namespace height_view_pass
{
#include "shaders/passes/height_view.glsl"
} // namespace height_view_pass
#include "tests/unit/glsl_again.h"
#undef VIEW_GROUND
#define VIEW_GROUND 2
namespace above_sea
{
#include "shaders/passes/view.glsl"
} // namespace above_sea
#include "tests/unit/glsl_again.h"
#undef VIEW_ABOVE
#define VIEW_ABOVE   0
#define FIELD_PACKED 1
namespace below_sea
{
#include "shaders/passes/view.glsl"
} // namespace below_sea
#include "tests/unit/glsl_again.h"
#undef VIEW_GROUND
#define VIEW_GROUND 0
namespace below_bare
{
#include "shaders/passes/view.glsl"
} // namespace below_bare
#include "tests/unit/glsl_again.h"
#undef VIEW_GROUND
#define VIEW_GROUND 3
namespace below_ice
{
#include "shaders/passes/view.glsl"
} // namespace below_ice
} // namespace glsl
#undef VIEW_ABOVE
#undef VIEW_CLOUDS

static void (*const cpu_pass[VARIANTS])(glsl::ivec2) = {glsl::clear::pass,       glsl::below::pass,       glsl::above::pass,
							glsl::below_paper::pass, glsl::above_paper::pass, glsl::below::pass,
							glsl::above::pass,       glsl::below_bare::pass,  glsl::below_sea::pass,
							glsl::below_ice::pass,   glsl::above_sea::pass};

enum { WIDTH = 96, HEIGHT = 72, LAYERS = 5 };
static const layer layers[LAYERS] = {LAYER_COLOR, LAYER_ORDER1, LAYER_MULTIPLE, LAYER_AIR, LAYER_OPTICAL_THICKNESS};

struct picture {
	std::vector<float> layer[LAYERS]; /* RGBA */
};

struct pipeline {
	gl_context *gl;
	kernel *optics_kernel;
	droplet_store *store;
	stage_context context;
	ground_stage ground;
	sky_stage sky;
	field_stage field;
	radiosity_stage radiosity;
	view_stage view;
	sea_stage sea;
};

/* What a frame is made of; valid until the next. */
struct made {
	ground_maps ground;
	sky_tables sky;
	field_maps field;
	radiosity_light light;
	const droplets *drops;
	const texture *slab_rows, *slab_slices, *sea_sky;
};

static pipeline shared;

static void start(pass_kind kind)
{
	const pass_compiler compiler = {kind, nullptr, false};
	shared.context.cache = cache_create(256u << 20);
	shared.context.droplets = shared.store;
	glCreateBuffers(1, &shared.context.block_buffer);
	glNamedBufferStorage(shared.context.block_buffer, sizeof shared.context.block, nullptr, GL_DYNAMIC_STORAGE_BIT);
	ground_stage_init(&shared.ground, &compiler);
	sea_stage_init(&shared.sea, &compiler);
	assert_true(sky_stage_init(&shared.sky, &compiler));
	assert_true(field_stage_init(&shared.field, &compiler) && radiosity_stage_init(&shared.radiosity, &compiler));
	assert_true(view_stage_init(&shared.view, &compiler));
}

static void stop()
{
	droplets_release(&shared.context);
	cache_destroy(shared.context.cache);
	view_stage_finish(&shared.view);
	sea_stage_finish(&shared.sea);
	radiosity_stage_finish(&shared.radiosity);
	field_stage_finish(&shared.field);
	sky_stage_finish(&shared.sky);
	ground_stage_finish(&shared.ground);
	glDeleteBuffers(1, &shared.context.block_buffer);
}

static scene make_scene(int variant)
{
	struct scene scene = scene_default();
	static const ground_type grounds[] = {GROUND_SAND, GROUND_SEA, GROUND_SEA_ICE, GROUND_SEA};
	const int side = variant < 3 ? variant : variant < FIRST_GROUND ? (variant % 2 ? 1 : 2) : variant == VARIANTS - 1 ? 2 : 1;
	scene.model.shading = variant == 3 || variant == 4 ? SHADING_PAPER : SHADING_SOLVED;
	if (variant == 5 || variant == 6)
		scene.sun.elevation_deg = 0.5;
	scene.output.width = WIDTH;
	scene.output.height = HEIGHT;
	scene.camera.azimuth_deg = 80;
	scene.clouds.resolution = 128;
	if (side == 0)
		scene.clouds.type = CLOUD_NONE;
	scene.camera.elevation_deg = side == 1 ? 25 : 8;
	if (variant >= FIRST_GROUND) {
		scene.ground.type = grounds[variant - FIRST_GROUND];
		scene.camera.elevation_deg = -10;
		scene.camera.azimuth_deg = 140;
	}
	if (side == 2) {
		scene.camera.position_m[2] = 2600;
		scene.camera.elevation_deg = -30;
		scene.camera.roll_deg = 12;
	}
	return scene;
}

static view_inputs inputs_of(const scene &scene, const made &out)
{
	return {&out.ground,
		out.drops,
		out.slab_rows,
		out.slab_slices,
		&out.sky,
		&out.field,
		scene.clouds.type == CLOUD_NONE ? nullptr : &out.light,
		nullptr,
		out.sea_sky,
		nullptr};
}

/* The stages in their order, as renderer.c runs them. */
static void run_stages(const scene &scene, made &out)
{
	const double albedo[3] = {0.3, 0.3, 0.25};
	stage_context *context = &shared.context;
	const bool clouds = scene.clouds.type != CLOUD_NONE;
	cache_begin_frame(context->cache);
	context->block = {};
	view_fill_block(&context->block, &scene);
	sea_fill_block(&context->block, &scene);
	context->block.cloud_layer[0] = (float)scene.clouds.base_m;
	context->block.cloud_layer[1] = (float)scene.clouds.thickness_m;
	context->block.cloud_layer[3] = clouds;
	out.drops = droplets_get(context, &scene);
	assert_non_null(out.drops);
	out.slab_rows = slab_rows_get(context, &scene, out.drops);
	assert_non_null(out.slab_rows);
	assert_true(slab_slices_get(context, &scene, out.drops, &out.slab_slices));
	assert_true(ground_stage_run(&shared.ground, context, &scene, &out.ground));
	assert_true(sky_stage_run(&shared.sky, context, &scene, albedo, &out.sky));
	assert_true(field_stage_run(&shared.field, context, &scene, field_uses(&scene), &out.field));
	for (int band = 0; band < 3; band++)
		context->block.air_below[band] = 1;
	if (clouds)
		assert_true(radiosity_stage_run(&shared.radiosity, context, &scene, &out.ground, &out.sky, &out.field, out.slab_rows,
						&out.light));
	stage_upload_block(context);
	if (scene.ground.type == GROUND_SEA) {
		const view_inputs inputs = inputs_of(scene, out);
		out.sea_sky = sea_stage_run(&shared.sea, context, &scene, &inputs);
		assert_non_null(out.sea_sky);
	}
}

static picture render_gpu(const scene &scene, made &out)
{
	picture picture;
	const texture *textures[LAYERS];
	run_stages(scene, out);
	const view_inputs inputs = inputs_of(scene, out);
	assert_true(view_stage_run(&shared.view, &shared.context, &scene, &inputs, layers, LAYERS, nullptr, nullptr, textures));
	for (int i = 0; i < LAYERS; i++) {
		picture.layer[i].resize(4 * WIDTH * HEIGHT);
		stage_read_texture(textures[i], 0, 4, picture.layer[i].data());
	}
	assert_false(gl_failed("rendering"));
	return picture;
}

/* A texture's texels and how it is sampled, as OpenGL says. */
static glsl::sampler2D copy_of(const texture *texture)
{
	auto image = std::make_shared<glsl::image>();
	GLint wrap_s, wrap_t, filter;
	if (!texture)
		return nullptr;
	glGetTextureParameteriv(texture->id, GL_TEXTURE_WRAP_S, &wrap_s);
	glGetTextureParameteriv(texture->id, GL_TEXTURE_WRAP_T, &wrap_t);
	glGetTextureParameteriv(texture->id, GL_TEXTURE_MAG_FILTER, &filter);
	image->repeat_x = wrap_s == GL_REPEAT;
	image->repeat_y = wrap_t == GL_REPEAT;
	image->nearest = filter == GL_NEAREST;
	for (int level = 0; level < texture->levels; level++) {
		glsl::image::level to;
		to.width = glm::max(1, texture->width >> level);
		to.height = glm::max(1, texture->height >> level);
		to.texels.resize((size_t)to.width * (size_t)to.height);
		stage_read_texture(texture, level, 4, &to.texels[0].x);
		image->levels.push_back(to);
	}
	return image;
}

static glsl::volume copy_of_volume_level(const texture *texture, int level, bool repeat)
{
	glsl::volume volume;
	volume.repeat = repeat;
	glGetTextureLevelParameteriv(texture->id, level, GL_TEXTURE_WIDTH, &volume.width);
	glGetTextureLevelParameteriv(texture->id, level, GL_TEXTURE_HEIGHT, &volume.height);
	glGetTextureLevelParameteriv(texture->id, level, GL_TEXTURE_DEPTH, &volume.depth);
	volume.texels.resize((size_t)volume.width * (size_t)volume.height * (size_t)volume.depth);
	glGetTextureImage(texture->id, level, GL_RGBA, GL_FLOAT, (GLsizei)(volume.texels.size() * sizeof(glsl::vec4)), &volume.texels[0].x);
	return volume;
}

static glsl::sampler3D copy_of_volume(const texture *texture)
{
	GLint wrap;
	if (!texture)
		return nullptr;
	glGetTextureParameteriv(texture->id, GL_TEXTURE_WRAP_R, &wrap);
	auto volume = std::make_shared<glsl::volume>(copy_of_volume_level(texture, 0, wrap == GL_REPEAT));
	for (int level = 1; level < texture->levels; level++)
		volume->coarser.push_back(copy_of_volume_level(texture, level, wrap == GL_REPEAT));
	return volume;
}

static void copy_textures(const made &out)
{
	glsl::transmittance_table = copy_of(out.sky.transmittance);
	glsl::sky_total = copy_of(out.sky.total);
	glsl::sky_near = copy_of(out.sky.near);
	glsl::air_to_layer = copy_of(out.sky.to_layer);
	glsl::air_to_end = copy_of(out.sky.to_end);
	glsl::ground_map = copy_of(out.ground.map);
	glsl::sea_sky = copy_of(out.sea_sky);
	glsl::field_coarse = copy_of(out.field.coarse_packed ? out.field.coarse_packed : out.field.coarse);
	glsl::field_detail = copy_of(out.field.detail_packed ? out.field.detail_packed : out.field.detail);
	glsl::height_table = copy_of(out.field.height);
	glsl::height_light = copy_of(out.field.light ? &out.field.light->surface : nullptr);
	glsl::height_near_light = copy_of(out.field.light ? &out.field.light->near : nullptr);
	glsl::height_puff_layers = copy_of(out.field.puffs ? &out.field.puffs->layers : nullptr);
	glsl::height_puffs = copy_of_volume(out.field.puffs ? &out.field.puffs->volume : nullptr);
	glsl::smooth_table = copy_of(out.field.smooth);
	glsl::side_light = copy_of(out.field.sides);
	glsl::thickness_packed = copy_of(out.field.thickness_packed);
	glsl::phase_table = copy_of(&out.drops->phase);
	glsl::event_table = copy_of(&out.drops->events);
	glsl::slab_table = copy_of(out.slab_rows);
	glsl::slab_slices = copy_of_volume(out.slab_slices);
	glsl::ground_received = copy_of(out.light.ground_received);
	glsl::cloud_received = copy_of(out.light.cloud_received);
	GLint bytes = 0;
	glGetNamedBufferParameteriv(shared.view.disc.buffer, GL_BUFFER_SIZE, &bytes);
	glsl::sun_disc_weights.resize((size_t)bytes / sizeof(float));
	glGetNamedBufferSubData(shared.view.disc.buffer, 0, bytes, glsl::sun_disc_weights.data());
}

/* What a pass stores, as a texture. */
static glsl::sampler2D pass_to_texture(void (*pass)(glsl::ivec2), int output, int width, int height)
{
	auto image = std::make_shared<glsl::image>();
	image->nearest = true;
	image->levels.push_back({width, height, {}});
	for (int y = 0; y < height; y++)
		for (int x = 0; x < width; x++) {
			pass(glsl::ivec2(x, y));
			image->levels[0].texels.push_back(glsl::stored[output]);
		}
	return image;
}

static glsl::sampler2D begin_blocks(int side, int begun)
{
	glsl::arguments[0] = glsl::vec4((float)side, (float)begun, 0.0f, 0.0f);
	return pass_to_texture(glsl::height_start_pass::pass, 0, (WIDTH + side - 1) / side, (HEIGHT + side - 1) / side);
}

/* What the height view stage makes of a camera above the clouds. */
static void look_at_heights()
{
	const int block = glsl::height_start_pass::HEIGHT_BLOCK;
	glsl::height_start = begin_blocks(4 * block, 0);
	glsl::height_start = begin_blocks(block, 4 * block);
	glsl::arguments[0] = glsl::vec4(0.0f);
	glsl::seen_place = pass_to_texture(glsl::height_view_pass::pass, 0, WIDTH, HEIGHT);
	glsl::seen_light = pass_to_texture(glsl::height_view_pass::pass, 1, WIDTH, HEIGHT);
}

static picture render_cpu(int variant, const made &out)
{
	picture picture;
	copy_textures(out);
	glsl::set_scene_block(shared.context.block);
	if (out.field.light)
		look_at_heights();
	for (int i = 0; i < LAYERS; i++) {
		glsl::arguments[0].x = (float)layers[i];
		/* All paths are shown, and all rows are held. */
		glsl::arguments[1] = glsl::arguments[2] = glsl::vec4(1.0f);
		glsl::arguments[3] = glsl::vec4(1.0f, 1.0f, 0.0f, 0.0f);
		for (int y = 0; y < HEIGHT; y++)
			for (int x = 0; x < WIDTH; x++) {
				cpu_pass[variant](glsl::ivec2(x, y));
				for (int k = 0; k < 4; k++)
					picture.layer[i].push_back(glsl::stored[0][k]);
			}
	}
	return picture;
}

struct difference {
	double psnr;    /* against the largest value, dB */
	double outside; /* share of pixels that differ by more than a thousandth of the largest value */
};

static difference compare(const std::vector<float> &a, const std::vector<float> &b)
{
	double peak = 0, squares = 0;
	int outside = 0;
	for (size_t i = 0; i < a.size(); i++)
		if (i % 4 < 3)
			peak = std::fmax(peak, (double)a[i]);
	for (size_t i = 0; i < a.size(); i++) {
		const double d = (double)a[i] - (double)b[i];
		assert_true(std::isfinite(d));
		squares += i % 4 < 3 ? d * d : 0;
		outside += i % 4 < 3 && std::fabs(d) > 1e-3 * peak;
	}
	const double count = 0.75 * (double)a.size(), mean_square = squares / count;
	if (mean_square <= 1e-12 * peak * peak)
		return {120, outside / count}; /* also where both are black */
	return {10 * std::log10(peak * peak / mean_square), outside / count};
}

static void compare_layers(const char *what, const picture &a, const picture &b, double floor, double outside)
{
	for (int i = 0; i < LAYERS; i++) {
		const difference d = compare(a.layer[i], b.layer[i]);
		print_message("%s, %s: %.1f dB, %.2f %% of values differ by over 0.1 %%\n", what, scene_layer_names[layers[i]], d.psnr,
			      100 * d.outside);
		assert_true(d.psnr >= floor);
		assert_true(d.outside <= outside);
	}
}

static picture by_fragments[VARIANTS];

static void gpu_shows_what_the_library_says(void **)
{
	/* Hardware interpolates textures with fractions of 8 bits. From above, a ray that grazes a top may meet it a step later. */
	const double floor = gl_context_info(shared.gl)->software ? 80 : 50;
	start(PASS_FRAGMENT);
	for (int i = 0; i < VARIANTS; i++) {
		made out = {};
		by_fragments[i] = render_gpu(make_scene(i), out);
		/* Of bytes even software interpolates in bytes, and the puffs on tops are such. */
		const bool bytes = out.field.puffs;
		compare_layers(variant_names[i], by_fragments[i], render_cpu(i, out), bytes ? 50 : floor, bytes ? 0.25 : 0.02);
	}
	stop();
}

static void compute_shows_what_fragments_show(void **)
{
	start(PASS_COMPUTE);
	for (int i = 0; i < VARIANTS; i++) {
		made out = {};
		compare_layers(variant_names[i], by_fragments[i], render_gpu(make_scene(i), out), 90, 0.02);
	}
	stop();
}

/* The programs that make the color alone, for parts of the picture, against the one that makes all layers. From below they take what is
 * smooth out of tables. */
static void color_alone_is_the_color(void **)
{
	start(PASS_FRAGMENT);
	for (int i = 0; i < VARIANTS; i++) {
		made out = {};
		const scene scene = make_scene(i);
		const texture *color;
		const layer wanted = LAYER_COLOR;
		std::vector<float> texels(4 * WIDTH * HEIGHT);
		run_stages(scene, out);
		const view_inputs inputs = inputs_of(scene, out);
		assert_true(view_stage_run(&shared.view, &shared.context, &scene, &inputs, &wanted, 1, nullptr, nullptr, &color));
		stage_read_texture(color, 0, 4, texels.data());
		const difference d = compare(by_fragments[i].layer[0], texels);
		print_message("%s: the color alone: %.1f dB\n", variant_names[i], d.psnr);
		const bool tables = strncmp(variant_names[i], "below", 5) == 0 && scene.model.shading == SHADING_SOLVED && i != 5;
		if (tables)
			assert_true(d.psnr >= 60 && d.outside <= 0.1); /* closer: test_view_up.c */
		else
			assert_true(d.psnr >= 90 && d.outside <= 0.001);
	}
	stop();
}

/* Facets of the tops are as soft as light goes deep: flat ones are as they were, averted ones get some light, none more than it has cosine.
 */
static void facets_are_soft(void **)
{
	for (float flat : {0.05f, 0.2f, 0.7f}) {
		assert_float_equal(glsl::above::view_facet_cosine(flat, flat), flat, 1e-6);
		assert_in_range((long)(1e3f * glsl::above::view_facet_cosine(-0.2f, flat)), 5, 90);
		float last = 0;
		for (int i = -20; i <= 20; i++) {
			const float facet = 0.05f * (float)i, cosine = glsl::above::view_facet_cosine(facet, flat);
			assert_true(cosine > last);
			assert_true(facet <= flat || cosine < facet);
			last = cosine;
		}
	}
}

int main()
{
	const char *path = getenv("STRATUS_KERNEL");
	const CMUnitTest tests[] = {
		cmocka_unit_test(gpu_shows_what_the_library_says),
		cmocka_unit_test(compute_shows_what_fragments_show),
		cmocka_unit_test(facets_are_soft),
		cmocka_unit_test(color_alone_is_the_color),
	};
	shared.gl = gl_context_create(-1, false);
	if (!shared.gl)
		return 77;
	shared.optics_kernel = kernel_load(path ? path : "build/mie.kernel");
	droplet_store_params params = {};
	params.kernel = shared.optics_kernel;
	shared.store = shared.optics_kernel ? droplet_store_create(&params) : nullptr;
	const int failed = shared.store ? cmocka_run_group_tests(tests, nullptr, nullptr) : 1;
	droplet_store_destroy(shared.store);
	kernel_destroy(shared.optics_kernel);
	gl_context_destroy(shared.gl);
	return failed;
}
