/* The GLSL library compiled for the processor: slab, phase table, colour and noise, against independent values. */
extern "C" {
#include "renderer/image/develop.h"
#include "renderer/stages/colour.h"
#include "renderer/stages/slab_tables.h"
}
#include "tests/unit/glsl_shim.h"

#include <complex>
#include <cstdarg>
#include <csetjmp>
#include <cstdint>
extern "C" {
#include <cmocka.h>
}

namespace glsl
{
namespace cloud
{
#include "shaders/lib/colour.glsl"
#include "shaders/lib/slab_solved.glsl"
} // namespace cloud
} // namespace glsl

using namespace glsl::cloud;
using glsl::vec2;
using glsl::vec3;
using glsl::vec4;

#define assert_near(a, b, tolerance)                                                                                                       \
	do {                                                                                                                               \
		const double a_ = (double)(a), b_ = (double)(b), t_ = (double)(tolerance);                                                 \
		if (!(std::fabs(a_ - b_) <= t_))                                                                                           \
			fail_msg("%s = %.9g, expected %.9g within %.3g", #a, a_, b_, t_);                                                  \
	} while (0)

/* --- slab ------------------------------------------------------------------------------------------------------------------------- */

/* Light scattered once at depth x of the slab and leaving it, integrated over x by Simpson's rule. */
static double single(double tau, double mu_l, double mu_v, bool through)
{
	const int steps = 2000;
	double sum = 0;
	for (int i = 0; i <= steps; i++) {
		const double x = tau * i / steps, out = through ? tau - x : x;
		sum += (i == 0 || i == steps ? 1 : i % 2 ? 4 : 2) * std::exp(-x / mu_l - out / mu_v);
	}
	return sum * tau / steps / 3 / mu_v;
}

static void single_scattering_is_its_integral(void **)
{
	for (double tau : {1e-4, 0.01, 0.3, 2., 9.})
		for (double mu_l : {0.03, 0.2, 0.5, 0.5005, 1.})
			for (double mu_v : {0.03, 0.2, 0.5, 1.}) {
				const double t = single(tau, mu_l, mu_v, true), r = single(tau, mu_l, mu_v, false);
				assert_near(slab_single_transmitted(vec3((float)tau), (float)mu_l, (float)mu_v).y, t, 3e-4 * t + 1e-7);
				assert_near(slab_single_reflected(vec3((float)tau), (float)mu_l, (float)mu_v).y, r, 3e-4 * r + 1e-7);
			}
}

static void single_scattering_at_equal_cosines(void **)
{
	for (double mu : {0.05, 0.3, 0.77, 1.})
		for (double tau : {1e-3, 0.2, 1., 5.}) {
			const double wanted = tau / mu * std::exp(-tau / mu);
			assert_near(slab_single_transmitted(vec3((float)tau), (float)mu, (float)mu).x, wanted, 1e-5 * wanted + 1e-8);
			/* and no dark arc beside it */
			for (double off : {1e-7, 1e-5, 1e-3, 4e-3}) {
				const double beside = single(tau, mu, mu * (1 - off), true);
				assert_near(slab_single_transmitted(vec3((float)tau), (float)mu, (float)(mu * (1 - off))).x, beside,
					    1e-3 * beside + 1e-8);
			}
		}
}

static void thin_slabs_scatter_in_proportion(void **)
{
	for (double mu_l : {0.2, 0.9})
		for (double mu_v : {0.1, 0.6}) {
			const double tau = 1e-5;
			assert_near(slab_single_transmitted(vec3((float)tau), (float)mu_l, (float)mu_v).z / (float)tau, 1 / mu_v,
				    5e-3 / mu_v);
			assert_near(slab_single_reflected(vec3((float)tau), (float)mu_l, (float)mu_v).z / (float)tau, 1 / mu_v,
				    2e-2 / mu_v);
		}
	assert_near(slab_single_transmitted(vec3(0.f), 0.4f, 0.7f).x, 0, 0);
	assert_near(slab_single_reflected(vec3(0.f), 0.4f, 0.7f).x, 0, 0);
	/* A thick one: mu_l/(mu_l + mu_v) back, nothing through. */
	assert_near(slab_single_reflected(vec3(200.f), 0.4f, 0.7f).x, 0.4 / 1.1, 1e-6);
	assert_near(slab_single_transmitted(vec3(200.f), 0.4f, 0.7f).x, 0, 1e-9);
}

/* I(mu_l, mu_v)/mu_l = I(mu_v, mu_l)/mu_v. */
static void single_scattering_is_reciprocal(void **)
{
	for (double tau : {0.02, 0.7, 4.})
		for (double a : {0.05, 0.33, 0.8})
			for (double b : {0.1, 0.5, 1.}) {
				const vec3 t((float)tau);
				const float l = (float)a, v = (float)b;
				const double through = (double)slab_single_transmitted(t, l, v).x / a,
					     back = (double)slab_single_reflected(t, l, v).x / a;
				assert_near((double)slab_single_transmitted(t, v, l).x / b, through, 2e-5 * through + 1e-9);
				assert_near((double)slab_single_reflected(t, v, l).x / b, back, 2e-5 * back + 1e-9);
			}
}

/* For isotropic droplets, what leaves after one event is what meets a first one less what meets a second. */
static void single_scattering_keeps_the_energy(void **)
{
	const double mu_l = 0.6, tau = 0.8;
	double left = 0, expected = 0;
	const int steps = 2000;
	for (int i = 0; i < steps; i++) {
		const double mu_v = (i + 0.5) / steps;
		const vec3 t((float)tau);
		left += 2 * M_PI / steps * mu_v / (4 * M_PI) *
			(double)(slab_single_transmitted(t, (float)mu_l, (float)mu_v).x +
				 slab_single_reflected(t, (float)mu_l, (float)mu_v).x);
	}
	/* Escape from depth x is (E_2(x) + E_2(tau - x))/2; E_2 by its integral. */
	const int depths = 400;
	for (int i = 0; i < depths; i++) {
		const double x = tau * (i + 0.5) / depths;
		double escape = 0;
		for (int k = 0; k < 1000; k++) {
			const double mu = (k + 0.5) / 1000;
			escape += 0.5 / 1000 * (std::exp(-x / mu) + std::exp((x - tau) / mu));
		}
		expected += tau / depths * std::exp(-x / mu_l) * escape;
	}
	assert_near(left, expected, 1e-3 * expected);
}

/* --- phase table --------------------------------------------------------------------------------------------------------------------- */

/* The angle that the table's maker gives a column, and the column that the shader looks up for the angle. */
static void phase_columns_round_trip(void **)
{
	for (int i = 0; i < 2048; i++) {
		const double unit = (double)i / 2047, root = std::sqrt(2.);
		const double angle = unit < 0.5 ? 2 * std::asin(unit * root) : 2 * std::acos(std::fmin(1., (1 - unit) * root));
		const vec3 before(0, 0, 1), after(std::sin(angle), 0, std::cos(angle));
		const vec2 half = scattering_half_angle(before, after);
		assert_near(half.x, std::sin(angle / 2), 2e-6);
		assert_near(half.y, std::cos(angle / 2), 2e-6);
		assert_near(phase_unit(half), unit, 3e-6);
	}
	assert_near(PHASE_TABLE_WIDTH, DROPLET_PHASE_COLUMNS, 0);
	assert_near(EVENT_TABLE_SIZE.x, EVENT_TABLE_WIDTH, 0);
	assert_near(EVENT_TABLE_SIZE.y, 4 * EVENT_TABLE_DEPTHS, 0);
	assert_near(EVENT_DEPTHS, EVENT_TABLE_DEPTHS, 0);
	assert_near(FORWARD_PEAK_REACH, FORWARD_ANGLE_MAX, 1e-7);
	assert_near(FORWARD_PEAK_WIDTH, FORWARD_ANGLE_COUNT, 0);
	assert_near(FORWARD_DEPTH_MIN, forward_depth_at(0.5 / FORWARD_DEPTH_COUNT), 1e-7);
	assert_near(FORWARD_BLUR_WIDTH, BLUR_ANGLE_COUNT, 0);
	assert_near(SLAB_TABLE_SIZE.x, SLAB_TABLE_WIDTH, 0);
	assert_near(SLAB_TABLE_SIZE.y, SLAB_TABLE_HEIGHT, 0);
	assert_near(SLAB_VIEWS, SLAB_SLICE_VIEW_COUNT, 0);
	assert_near(SOLVED_DEPTHS, SLAB_SLICE_DEPTH_COUNT, 0);
	assert_near(SOLVED_AZIMUTHS, SLAB_SLICE_AZIMUTH_COUNT, 0);
	assert_near(SOLVED_DEPTH_MIN, SLAB_DEPTH_MIN, 1e-8);
	assert_near(SOLVED_DEPTH_LAST, slab_depth(SLAB_DEPTH_COUNT - 1), 0.5);
	assert_near(FORWARD_PEAK_SINE, std::sin(0.5 * (double)FORWARD_PEAK_ANGLE), 1e-7);
}

/* --- colour ------------------------------------------------------------------------------------------------------------------------------
 */

/* Sunlight above the air is 133 klx (solar constant 1361 W/m2, 98 lm/W), and its colour that of a black body of about 5900 K:
 * x 0.3233, y 0.3326 (ASTM E490). */
static void sunlight_above_the_air(void **)
{
	double matrix[3][3], rgb[3] = {};
	colour_band_matrix(matrix);
	assert_near(colour_luminance(colour_solar_irradiance), 133000, 0.02 * 133000);
	for (int channel = 0; channel < 3; channel++)
		for (int band = 0; band < 3; band++)
			rgb[channel] += matrix[channel][band] * colour_solar_irradiance[band];
	const double x = 0.4124 * rgb[0] + 0.3576 * rgb[1] + 0.1805 * rgb[2], y = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2],
		     z = 0.0193 * rgb[0] + 0.1192 * rgb[1] + 0.9505 * rgb[2];
	assert_near(x / (x + y + z), 0.3233, 0.004);
	assert_near(y / (x + y + z), 0.3326, 0.004);
	/* (1, 1, 1) stands for 1000 cd/m2: radiance as much as irradiance. */
	assert_near(1000 * y, colour_luminance(colour_solar_irradiance), 1e-3 * 1000 * y);
}

static void bands_become_colours(void **)
{
	double matrix[3][3];
	colour_band_matrix(matrix);
	/* As the block carries them: a column of the matrix per band and channel. */
	for (int band = 0; band < 3; band++) {
		glsl::band_red[band] = (float)(band == 0 ? 1 : 0);
		glsl::band_green[band] = (float)(band == 1 ? 1 : 0);
		glsl::band_blue[band] = (float)(band == 2 ? 1 : 0);
	}
	const vec3 rgb = colour_of_bands(vec3(0.25f, 0.5f, 0.75f));
	assert_near(rgb.x, 0.25, 0);
	assert_near(rgb.y, 0.5, 0);
	assert_near(rgb.z, 0.75, 0);
}

static void srgb_curve(void **)
{
	/* IEC 61966-2-1: codes of known linear values. */
	assert_near(colour_srgb(0), 0, 0);
	assert_near(colour_srgb(1), 1, 1e-6);
	assert_near(colour_srgb(0.2140411f), 0.5, 1e-6);
	assert_near(colour_srgb(0.0021f), 12.92 * 0.0021, 1e-7);
	assert_near(colour_srgb(0.0031308f), colour_srgb(0.0031309f), 1e-5);
	for (int code = 0; code < 256; code++) {
		const double v = code / 255., linear = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
		assert_near(colour_srgb((float)linear) * 255, code, 1e-3);
		assert_near(colour_srgb_near((float)linear) * 255, code, 0.01);
	}
}

static void power_near(void **)
{
	assert_near(colour_power_near(0), 0, 0);
	for (int i = -2000; i <= 3000; i++) {
		const double x = std::exp2(i * 0.01 + 0.0037);
		assert_near(colour_power_near((float)x) / std::pow(x, 1.15), 1, 1.3e-4);
	}
}

static void filmic_curve_rises(void **)
{
	float before = -1;
	for (int i = 0; i < 20000; i++) {
		const float x = i < 10000 ? (float)i * 1e-4f : std::exp2((float)(i - 10000) * 0.001f), y = colour_filmic(x);
		assert_true(y >= before && y >= 0 && y < 1);
		if (i > 0 && x < 40)
			assert_true(y > before);
		before = y;
	}
	assert_near(colour_filmic(0), 0, 0);
	assert_near(colour_filmic(0.18f), 0.15, 0.01);
	assert_near(colour_filmic(2), 0.79, 0.01);
	/* The shoulder keeps grades: what is five times white, forty times, and the sun's disc are several codes apart. */
	assert_near(colour_filmic(5), 0.91, 0.01);
	assert_true(colour_srgb(colour_filmic(40)) * 255 < 251);
	assert_true(colour_srgb(colour_filmic(1e5f)) * 255 > 254.4f);
}

static vec3 linear_of(double x, double y)
{
	/* CIE xyY to linear Rec.709 (IEC 61966-2-1), of luminance 1. */
	const double X = x / y, Z = (1 - x - y) / y;
	return vec3((float)(3.2406 * X - 1.5372 - 0.4986 * Z), (float)(-0.9689 * X + 1.8758 + 0.0415 * Z),
		    (float)(0.0557 * X - 0.2040 + 1.0570 * Z));
}

/* The sun at 20, 10, 5 and 2 degrees by a spectrum (docs/validation/sky.md), as bright as its disc is: the lower the warmer, never white
 * but when high. */
static void suns_keep_their_hue(void **)
{
	const double suns[][3] = {{0.356, 0.367, 5e5}, {0.387, 0.391, 4e5}, {0.439, 0.419, 2e5}, {0.521, 0.428, 3e4}};
	float blue = 1, green = 1;
	for (const double *sun : suns) {
		const vec3 shown = colour_filmic_hue(colour_into_gamut(linear_of(sun[0], sun[1])) * (float)sun[2] * COLOUR_FILM_BALANCE);
		assert_true(shown.x > 0.98f && shown.x <= 1);
		assert_true(shown.x >= shown.y && shown.y >= shown.z);
		assert_true(shown.y < green && shown.z < blue);
		green = shown.y;
		blue = shown.z;
	}
	/* Codes of 8 bits: that at 2 degrees is orange, not yellow, not red. */
	assert_true(colour_srgb(green) < 0.93f && colour_srgb(green) > 0.75f);
	assert_true(colour_srgb(blue) < 0.75f && colour_srgb(blue) > 0.4f);
}

/* More light of one colour is never shown darker by more than a code or two, and white stays white. */
static void brighter_is_brighter(void **)
{
	const vec3 weights(0.2126f, 0.7152f, 0.0722f);
	for (vec3 colour : {vec3(1), vec3(1, 0.7f, 0.3f), vec3(1, 0.3f, 0.02f), vec3(0.4f, 0.6f, 1), vec3(1, 0, 0)}) {
		float before = 0;
		for (int i = -60; i < 180; i++) {
			const vec3 shown = colour_filmic_hue(colour * std::exp2((float)i * 0.1f));
			const float code = 255 * colour_srgb(glm::dot(shown, weights));
			assert_true(shown.x >= 0 && shown.y >= 0 && shown.z >= 0 && shown.x <= 1 && shown.y <= 1 && shown.z <= 1);
			assert_true(code > before - 0.3f);
			before = code;
			if (colour == vec3(1)) {
				assert_near(shown.x, shown.z, 1e-6);
				assert_near(shown.x, colour_filmic(1.002f * std::exp2((float)i * 0.1f)), 1e-5);
			}
		}
	}
}

/* The tone of pictures that are in memory already is the same. */
static void processor_tones_alike(void **)
{
	for (float light : {0.05f, 0.7f, 3.f, 30.f, 2e4f})
		for (vec3 colour : {vec3(1), vec3(1, 0.7f, 0.3f), vec3(1, 0.2f, -0.02f), vec3(0.4f, 0.6f, 1)}) {
			const vec3 rgb = colour * light, shown = colour_filmic_hue(colour_into_gamut(rgb) * COLOUR_FILM_BALANCE);
			const float pixel[3] = {rgb.x, rgb.y, rgb.z};
			unsigned char codes[3];
			develop_picture(pixel, 1, 0, TONE_FILMIC, codes);
			for (int c = 0; c < 3; c++)
				assert_near(codes[c], 255 * colour_srgb(shown[c]), 0.51);
		}
}

static void gamut_keeps_luminance(void **)
{
	for (vec3 rgb : {vec3(-0.1f, 0.5f, 0.8f), vec3(0.7f, -0.02f, 0.1f), vec3(0.3f, 0.4f, -0.2f)}) {
		const vec3 inside = colour_into_gamut(rgb), weights(0.2126f, 0.7152f, 0.0722f);
		assert_true(inside.x >= 0 && inside.y >= 0 && inside.z >= 0);
		assert_near(glm::dot(inside, weights), glm::dot(rgb, weights), 1e-6);
	}
	const vec3 kept = colour_into_gamut(vec3(0.2f, 0.3f, 4.f));
	assert_near(kept.z, 4, 0);
}

int main()
{
	const CMUnitTest tests[] = {
		cmocka_unit_test(single_scattering_is_its_integral),
		cmocka_unit_test(single_scattering_at_equal_cosines),
		cmocka_unit_test(thin_slabs_scatter_in_proportion),
		cmocka_unit_test(single_scattering_is_reciprocal),
		cmocka_unit_test(single_scattering_keeps_the_energy),
		cmocka_unit_test(phase_columns_round_trip),
		cmocka_unit_test(sunlight_above_the_air),
		cmocka_unit_test(bands_become_colours),
		cmocka_unit_test(srgb_curve),
		cmocka_unit_test(power_near),
		cmocka_unit_test(filmic_curve_rises),
		cmocka_unit_test(suns_keep_their_hue),
		cmocka_unit_test(brighter_is_brighter),
		cmocka_unit_test(processor_tones_alike),
		cmocka_unit_test(gamut_keeps_luminance),
	};
	return cmocka_run_group_tests(tests, nullptr, nullptr);
}
