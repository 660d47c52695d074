/* Exchange of light between the cloud base and the ground: the kernel's weights against its transform, squares against their form factor,
 * energy, and the closed form of uniform planes. The passes run as the stage runs them, on planes of the test's own; skipped where no
 * OpenGL context comes up. */
#include "renderer/gl/context.h"
#include "renderer/log.h"
#include "renderer/stages/exchange_weights.h"
#include "renderer/stages/radiosity.h"
#include "renderer/stages/stage.h"

#include <epoxy/gl.h>

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { SIDE = EXCHANGE_SIDE, TEXELS = SIDE * SIDE, START = 0, EXCHANGE, CLOSE, REDUCE, PASSES };

/* --- weights --------------------------------------------------------------------------------------------------------------------- */

/* Bessel function J_0 by its integral. */
static double bessel_j0(double x)
{
	enum { STEPS = 4000 };
	double sum = 0;
	for (int i = 0; i < STEPS; i++)
		sum += cos(x * sin(M_PI * (i + 0.5) / STEPS));
	return sum / STEPS;
}

/* Hankel transform of h^2/(pi (h^2 + d^2)^2) for h = 1; with s = d^2/(1 + d^2) the kernel's mass is uniform in s. */
static double kernel_transform(double k)
{
	enum { STEPS = 1500 };
	double sum = 0;
	for (int i = 0; i < STEPS; i++) {
		const double s = (i + 0.5) / STEPS;
		sum += bessel_j0(k * sqrt(s / (1 - s))) / STEPS;
	}
	return sum;
}

static void kernel_has_its_transform(void **state)
{
	(void)state;
	for (double k = 0.05; k < 7; k *= 1.9) {
		assert_float_equal(exchange_kernel_transform(k, 1), kernel_transform(k), 2e-3);
		assert_float_equal(exchange_kernel_transform(k / 700, 700), exchange_kernel_transform(k, 1), 1e-12);
	}
	assert_float_equal(exchange_kernel_transform(0, 1), 1, 0);
	/* Published: K_1(1) = 0.6019072302, 2 K_1(2) = 0.2797317636, 4 K_1(4) = 0.0499340. */
	assert_float_equal(exchange_kernel_transform(1, 1), 0.6019072302, 1e-6);
	assert_float_equal(exchange_kernel_transform(2, 1), 0.2797317636, 1e-6);
	assert_float_equal(exchange_kernel_transform(4, 1), 0.0499340, 1e-6);
}

/* How well the sum of kernels follows the transform, where the tile has waves and the finest kernel can. */
static void weights_follow_the_transform(void **state)
{
	(void)state;
	for (double tile = 2000; tile <= 200000; tile *= 10)
		for (double h = 100; h <= 12000; h *= 3) {
			double weights[EXCHANGE_LEVELS], sum = 0, worst = 0;
			exchange_weights(tile, h, weights);
			for (int i = 0; i < EXCHANGE_LEVELS; i++) {
				assert_true(weights[i] >= 0);
				sum += weights[i];
			}
			assert_float_equal(sum, 1, 1e-12);
			const double texel = tile / SIDE;
			for (double wave = 1; wave < SIDE / 4; wave *= 1.3) {
				const double k = 2 * M_PI * wave / tile;
				double found = 0;
				for (int i = 0; i < EXCHANGE_LEVELS; i++)
					found += weights[i] * exchange_level_transform(k, texel, i);
				worst = fmax(worst, fabs(found - exchange_kernel_transform(k, h)));
			}
			print_message("tile %6.0f m, h %5.0f m (%.2f texels): transform off by at most %.4f\n", tile, h, h / texel, worst);
			/* A plane closer than a texel cannot be told from one at a texel's distance. */
			if (h >= 2 * texel)
				assert_true(worst < 0.006);
		}
}

/* --- passes ------------------------------------------------------------------------------------------------------------------------- */

static const struct pass_desc descs[PASSES] = {
	[START] = {.file = "shaders/passes/radiosity_start.glsl",
		   .outputs = 4,
		   .samplers = {"cloud_source", "ground_albedo_plane", "ground_direct"}},
	[EXCHANGE] = {.file = "shaders/passes/radiosity_exchange.glsl",
		      .outputs = 4,
		      .samplers = {"ground_received", "cloud_received", "ground_sends", "cloud_sends", "ground_albedo_plane",
				   "cloud_albedo_plane"}},
	[CLOSE] = {.file = "shaders/passes/radiosity_close.glsl",
		   .outputs = 2,
		   .samplers = {"ground_received", "cloud_received", "ground_sends", "cloud_sends", "ground_albedo_plane",
				"cloud_albedo_plane"}},
	[REDUCE] = {.file = "shaders/passes/radiosity_reduce.glsl", .outputs = 2, .samplers = {"first_below", "second_below"}},
};

static struct pass *passes[PASSES];
/* 0..3 and 4..7: ground received, base received, ground sends, base sends; albedos of ground and base; source, direct light. */
enum { GROUND_ALBEDO = 8, CLOUD_ALBEDO, SOURCE, DIRECT, SPARE, PLANES };
static struct texture planes[PLANES];

static void upload(int plane, const float *values)
{
	float *quads = calloc(TEXELS, 4 * sizeof *quads);
	assert_non_null(quads);
	for (int i = 0; i < TEXELS; i++)
		for (int k = 0; k < 4; k++)
			quads[4 * i + k] = values[i] * (float)(1 + k % 3); /* bands differ by known factors */
	texture_upload(&planes[plane], quads);
	radiosity_build_levels(passes[REDUCE], &planes[plane], &planes[SPARE]);
	free(quads);
}

static void upload_uniform(int plane, double value)
{
	float *values = malloc(TEXELS * sizeof *values);
	assert_non_null(values);
	for (int i = 0; i < TEXELS; i++)
		values[i] = (float)value;
	upload(plane, values);
	free(values);
}

/* First band of a plane. */
static void read_plane(int plane, float *values)
{
	stage_read_texture(&planes[plane], 0, 1, values);
}

static struct pass_run weights_run(double tile, double h)
{
	struct pass_run run = {0};
	double weights[EXCHANGE_LEVELS];
	exchange_weights(tile, h, weights);
	for (int i = 0; i < EXCHANGE_LEVELS; i++)
		run.arguments[i / 4][i % 4] = (float)weights[i];
	run.arguments[2][0] = 0;
	run.arguments[2][1] = EXCHANGE_LEVELS - 1;
	return run;
}

/* Runs a pass from one set of four planes (0 or 4) to the other. */
static void exchange(int kind, int from, struct pass_run run)
{
	struct texture *targets[4];
	for (int i = 0; i < 4; i++) {
		targets[i] = &planes[4 - from + i];
		run.samplers[i] = &planes[from + i];
	}
	run.targets = targets;
	run.samplers[4] = &planes[GROUND_ALBEDO];
	run.samplers[5] = &planes[CLOUD_ALBEDO];
	if (kind == START) {
		run.samplers[0] = &planes[SOURCE];
		run.samplers[1] = &planes[GROUND_ALBEDO];
		run.samplers[2] = &planes[DIRECT];
	}
	pass_run(passes[kind], &run);
	for (int i = 0; i < (kind == CLOSE ? 2 : 4); i += 2)
		radiosity_build_levels(passes[REDUCE], targets[i], targets[i + 1]);
}

/* --- the square ----------------------------------------------------------------------------------------------------------------------- */

/* Form factor from a point to a rectangle in a parallel plane, one corner above the point; odd in both sides. */
static double corner(double x, double y)
{
	const double a = sqrt(1 + x * x), b = sqrt(1 + y * y);
	return (x / a * atan(y / a) + y / b * atan(x / b)) / (2 * M_PI);
}

/* The same for a square of half-width a at the origin, seen from (x, y); lengths over h. */
static double square(double a, double x, double y)
{
	return corner(a - x, a - y) + corner(a + x, a - y) + corner(a - x, a + y) + corner(a + x, a + y);
}

/* With all periodic images; those beyond are as good as uniform. */
static double periodic_square(double a, double x, double y, double tile)
{
	enum { IMAGES = 12 };
	double sum = 0;
	for (int i = -IMAGES; i <= IMAGES; i++)
		for (int k = -IMAGES; k <= IMAGES; k++)
			sum += square(a, x + i * tile, y + k * tile);
	return sum + (1 - square((IMAGES + 0.5) * tile, 0, 0)) * (4 * a * a) / (tile * tile);
}

/* Largest difference from the form factor over the tile, in the emitter's value. Lengths in texels; the square covers columns and rows
 * 64 + shift - a .. 64 + shift + a. */
static double square_error(int a, int shift, double h)
{
	static float values[TEXELS];
	double worst = 0;
	for (int i = 0; i < TEXELS; i++) {
		const int x = i % SIDE - SIDE / 2 - shift, y = i / SIDE - SIDE / 2 - shift;
		values[i] = x >= -a && x < a && y >= -a && y < a;
	}
	for (int i = 0; i < 3; i++)
		upload_uniform(i, 0);
	upload(3, values);
	upload_uniform(GROUND_ALBEDO, 0);
	upload_uniform(CLOUD_ALBEDO, 0);
	exchange(EXCHANGE, 0, weights_run(SIDE, h));
	read_plane(4, values);
	/* Centre, edges, corner and outside, along the axis and the diagonal and between. */
	for (int y = SIDE / 2 + shift; y < SIDE; y += 3)
		for (int x = y; x < SIDE; x++) {
			const double u = x + 0.5 - SIDE / 2 - shift, v = y + 0.5 - SIDE / 2 - shift;
			worst = fmax(worst, fabs(values[y * SIDE + x] - periodic_square(a / h, u / h, v / h, SIDE / h)));
		}
	return worst;
}

static void analytic_values_are_known(void **state)
{
	(void)state;
	/* Centred squares of half-width h/2, h, 2h, 4h, 8h. */
	static const double halves[] = {0.5, 1, 2, 4, 8}, wanted[] = {0.239, 0.554, 0.831, 0.951, 0.987};
	for (int i = 0; i < 5; i++)
		assert_float_equal(square(halves[i], 0, 0), wanted[i], 6e-4);
}

/* At most 2 % of the emitter's value, from planes four texels apart on; closer ones ask for kernels narrower than the finest level has. */
static void squares_have_their_form_factor(void **state)
{
	(void)state;
	for (double h = 1; h <= 32; h *= 2) {
		double worst = 0;
		for (int a = 4; a <= 32; a *= 2)
			for (int shift = 0; shift < 16; shift += 5)
				worst = fmax(worst, square_error(a, shift, h));
		print_message("h %2.0f texels: squares off by at most %.4f\n", h, worst);
		assert_true(worst <= (h < 2 ? 0.055 : h < 4 ? 0.03 : 0.02));
	}
}

/* --- energy -----------------------------------------------------------------------------------------------------------------------------
 */

static double mean_of(int plane)
{
	static float values[TEXELS];
	double sum = 0;
	read_plane(plane, values);
	for (int i = 0; i < TEXELS; i++)
		sum += values[i];
	return sum / TEXELS;
}

static void nothing_is_created_or_lost(void **state)
{
	(void)state;
	static float values[TEXELS];
	uint32_t random = 7;
	for (double h = 0.5; h <= 200; h *= 3) {
		for (int i = 0; i < TEXELS; i++) {
			random = random * 1664525u + 1013904223u;
			values[i] = (random >> 28) == 0 ? (float)(random >> 8 & 0xffff) : 1;
		}
		upload(3, values);
		upload(2, values);
		for (int i = 0; i < 2; i++)
			upload_uniform(i, 0);
		exchange(EXCHANGE, 0, weights_run(SIDE, h));
		assert_float_equal(mean_of(4) / mean_of(3), 1, 1e-5);
		assert_float_equal(mean_of(5) / mean_of(2), 1, 1e-5);
	}
}

/* Uniform planes, in the first band: the series of all bounces, however many of them are run one by one. */
static void uniform_planes_close_the_series(void **state)
{
	(void)state;
	const double source = 0.7, direct = 0.4, albedo[][2] = {{0, 0.5}, {0.06, 0.3}, {0.5, 0.5}, {0.3, 0.9}, {0.33, 0.99}};
	for (size_t i = 0; i < sizeof albedo / sizeof *albedo; i++)
		for (int count = 1; count < 6; count++) {
			const double g = albedo[i][0], c = albedo[i][1], series = 1 / (1 - g * c);
			upload_uniform(SOURCE, source);
			upload_uniform(DIRECT, direct);
			upload_uniform(GROUND_ALBEDO, g);
			upload_uniform(CLOUD_ALBEDO, c);
			int at = 0;
			exchange(START, 4, weights_run(SIDE, 9));
			for (int k = 0; k < count; k++, at = 4 - at)
				exchange(EXCHANGE, at, weights_run(SIDE, 9));
			exchange(CLOSE, at, weights_run(SIDE, 9));
			at = 4 - at;
			const double ground = (source + g * c * direct) * series, base = g * (source + direct) * series;
			assert_float_equal(mean_of(at), ground, 2e-5 * ground);
			assert_float_equal(mean_of(at + 1), base, 2e-5 * base + 1e-9);
		}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(kernel_has_its_transform),   cmocka_unit_test(weights_follow_the_transform),
		cmocka_unit_test(analytic_values_are_known),  cmocka_unit_test(squares_have_their_form_factor),
		cmocka_unit_test(nothing_is_created_or_lost), cmocka_unit_test(uniform_planes_close_the_series),
	};
	const struct pass_compiler compiler = {.kind = PASS_FRAGMENT};
	log_set_level(LOG_ERROR);
	struct gl_context *gl = gl_context_create(-1, false);
	if (!gl)
		return 77;
	bool ok = stage_create_passes(&compiler, descs, passes, PASSES);
	for (int i = 0; i < PLANES; i++)
		ok = texture_init(&planes[i], SIDE, SIDE, TEXTURE_RGBA32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS) && ok;
	/* No pass here reads the block, but every pass sees it. */
	struct stage_context context = {0};
	glCreateBuffers(1, &context.block_buffer);
	glNamedBufferStorage(context.block_buffer, sizeof context.block, NULL, GL_DYNAMIC_STORAGE_BIT);
	stage_upload_block(&context);
	const int failed = ok ? cmocka_run_group_tests(tests, NULL, NULL) : 1;
	for (int i = 0; i < PLANES; i++)
		texture_finish(&planes[i]);
	stage_destroy_passes(passes, PASSES);
	glDeleteBuffers(1, &context.block_buffer);
	gl_context_destroy(gl);
	return failed;
}
