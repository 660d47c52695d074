/* Error figures between pictures, developing on the processor, FLIP and false colours. */
#include "renderer/image/develop.h"
#include "renderer/image/difference.h"
#include "renderer/image/false_colour.h"
#include "renderer/image/flip.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* --- figures
 * ------------------------------------------------------------------------------------------------------------------------------ */

/* 2 over 1 in one pixel, 1 over 1 in the other, of which the mask takes both or one. */
static void test_difference_of_known_pixels(void **state)
{
	(void)state;
	const float picture[6] = {2, 2, 2, 1, 1, 1}, truth[6] = {1, 1, 1, 1, 1, 1};
	const uint8_t mask[2] = {1, 3};
	const struct difference_pair pair = {.picture = picture, .truth = truth};
	struct difference both = difference_measure(&pair, mask, 1, 2), second = difference_measure(&pair, mask, 2, 2);
	assert_int_equal(both.pixels, 2);
	assert_true(fabs(both.bias - 0.5) < 1e-12 && fabs(both.rms - sqrt(0.5)) < 1e-12 && both.noise == 0);
	assert_true(fabs(both.noise_corrected_rms - both.rms) < 1e-12 && both.noise_corrected_rms_standard_error == 0);
	assert_int_equal(second.pixels, 1);
	assert_true(second.bias == 0 && second.rms == 0);
}

static void test_difference_is_relative_and_tells_channels(void **state)
{
	(void)state;
	const float truth[3] = {100, 200, 300}, picture[3] = {110, 200, 270};
	const uint8_t mask[1] = {1};
	const struct difference_pair pair = {.picture = picture, .truth = truth};
	const struct difference d = difference_measure(&pair, mask, 1, 1);
	assert_true(fabs(d.truth_mean - 200) < 1e-9 && fabs(d.bias - (-20.0 / 3 / 200)) < 1e-9);
	assert_true(fabs(d.channel_bias[0] - 0.1) < 1e-6 && d.channel_bias[1] == 0 && fabs(d.channel_bias[2] + 0.1) < 1e-6);
	assert_true(fabs(d.rms - sqrt((100 + 900) / 3.0) / 200) < 1e-9);
}

static void test_nothing_has_no_figures(void **state)
{
	(void)state;
	const float black[3] = {0, 0, 0}, white[3] = {1, 1, 1};
	const uint8_t mask[1] = {1};
	const struct difference_pair pair = {.picture = white, .truth = black};
	const struct difference none = difference_measure(&pair, mask, 2, 1), dark = difference_measure(&pair, mask, 1, 1);
	assert_int_equal(none.pixels, 0);
	assert_true(isnan(none.rms) && isnan(none.bias) && isnan(difference_span(white, mask, 2, 1).mean));
	assert_true(dark.pixels == 1 && isnan(dark.rms) && isnan(dark.bias));
}

/* Numbers of a normal distribution, by the sum of twelve. */
static double normal(unsigned *seed)
{
	double sum = -6;
	for (int i = 0; i < 12; i++)
		sum += rand_r(seed) / (double)RAND_MAX;
	return sum;
}

/* A picture 10 % too bright, seen through noise of 30 %: the noise is told from the error, and the bias lies within its own. */
static void test_noise_is_taken_out(void **state)
{
	(void)state;
	enum { COUNT = 200000 };
	float *picture = malloc(3 * COUNT * sizeof *picture), *truth = malloc(3 * COUNT * sizeof *truth),
	      *error = malloc(3 * COUNT * sizeof *error);
	uint8_t *mask = malloc(COUNT);
	unsigned seed = 7;
	for (int i = 0; i < 3 * COUNT; i++) {
		picture[i] = 5.5f;
		error[i] = 1.5f;
		truth[i] = (float)(5 + 1.5 * normal(&seed));
	}
	memset(mask, 1, COUNT);
	const struct difference_pair pair = {.picture = picture, .truth = truth, .truth_error = error};
	const struct difference d = difference_measure(&pair, mask, 1, COUNT);
	assert_true(fabs(d.rms - hypot(0.1, 0.3)) < 2e-3 && fabs(d.noise - 0.3) < 1e-3);
	assert_true(fabs(d.noise_corrected_rms - 0.1) < 3 * d.noise_corrected_rms_standard_error);
	/* Squares of a normal distribution of 0.3 about 0.1 scatter by 0.14 (3 channels, 200000 pixels), over twice 0.1. */
	assert_true(fabs(d.noise_corrected_rms_standard_error - sqrt((2 * pow(0.3, 4) + 4 * 0.09 * 0.01) / (3.0 * COUNT)) / 0.2) < 1e-4);
	/* Channels err apart here, so that the bound for those that err together is wide: root of three. */
	assert_true(fabs(d.bias_standard_error - 0.3 / sqrt(COUNT)) < 1e-5);
	assert_true(fabs(d.bias - 0.1) < 4 * d.bias_standard_error);
	free(picture);
	free(truth);
	free(error);
	free(mask);
}

static void test_no_more_is_taken_out_than_there_is(void **state)
{
	(void)state;
	const float value[3] = {1, 1, 1}, error[3] = {0.5f, 0.5f, 0.5f};
	const uint8_t mask[1] = {1};
	const struct difference_pair pair = {value, value, error, error};
	const struct difference d = difference_measure(&pair, mask, 1, 1);
	assert_true(d.noise_corrected_rms == 0 && fabs(d.noise - sqrt(0.5)) < 1e-6);
}

/* --- developing
 * --------------------------------------------------------------------------------------------------------------------------- */

static void test_develop_codes(void **state)
{
	(void)state;
	/* sRGB: 0.5 is 188, 0.18 is 118 (IEC 61966-2-1); two stops lighten 0.045 to 0.18. Negative channels are drawn into the gamut. */
	const float pixels[] = {0, 0, 0, 0.5f, 0.5f, 0.5f, 0.18f, 0.18f, 0.18f, 9, 9, 9, 0.5f, 0.5f, -0.1f};
	unsigned char codes[15];
	develop_picture(pixels, 5, 0, TONE_LINEAR, codes);
	assert_int_equal(codes[0], 0);
	assert_int_equal(codes[3], 188);
	assert_int_equal(codes[6], 118);
	assert_int_equal(codes[9], 255);
	assert_int_equal(codes[14], 0);
	assert_in_range(codes[12], 180, 187);
	const float dark[] = {0.045f, 0.045f, 0.045f};
	develop_picture(dark, 1, 2, TONE_LINEAR, codes);
	assert_int_equal(codes[1], 118);
	/* The film's middle grey, 0.15 (shaders/lib/colour.glsl). */
	const float grey[] = {0.18f / 0.93f, 0.18f / 1.015f, 0.18f / 1.10f};
	develop_picture(grey, 1, 0, TONE_FILMIC, codes);
	for (int c = 0; c < 3; c++)
		assert_in_range(codes[c], 106, 111);
}

/* --- FLIP
 * --------------------------------------------------------------------------------------------------------------------------------- */

enum { SIDE = 48 };

typedef void painter(int x, int y, unsigned char rgb[3]);

static void paint(painter *of, unsigned char codes[3 * SIDE * SIDE])
{
	for (int i = 0; i < SIDE * SIDE; i++)
		of(i % SIDE, i / SIDE, codes + 3 * i);
}

static bool go_on(void *context)
{
	(void)context;
	return false;
}

/* Says so from the n-th time on. */
static bool count_down(void *context)
{
	int *left = context;
	return --*left < 0;
}

static void flip_of(painter *first, painter *second, double per_degree, float map[SIDE * SIDE])
{
	static unsigned char a[3 * SIDE * SIDE], b[3 * SIDE * SIDE];
	struct flip_picture truth, picture;
	paint(first, a);
	paint(second, b);
	assert_true(flip_picture_init(&truth, a, SIDE, SIDE, per_degree, go_on, NULL));
	assert_true(flip_picture_init(&picture, b, SIDE, SIDE, per_degree, go_on, NULL));
	flip_compare(&truth, &picture, 0, SIDE * SIDE, map);
	flip_picture_finish(&truth);
	flip_picture_finish(&picture);
}

static void black(int x, int y, unsigned char rgb[3])
{
	(void)x, (void)y;
	memset(rgb, 0, 3);
}

static void white(int x, int y, unsigned char rgb[3])
{
	(void)x, (void)y;
	memset(rgb, 255, 3);
}

static void green(int x, int y, unsigned char rgb[3])
{
	black(x, y, rgb);
	rgb[1] = 255;
}

static void blue(int x, int y, unsigned char rgb[3])
{
	black(x, y, rgb);
	rgb[2] = 255;
}

static void grey(int x, int y, unsigned char rgb[3])
{
	(void)x, (void)y;
	memset(rgb, 128, 3);
}

static void checks(int x, int y, unsigned char rgb[3])
{
	memset(rgb, (x + y) & 1 ? 255 : 0, 3);
}

static void half(int x, int y, unsigned char rgb[3])
{
	(void)y;
	memset(rgb, x < SIDE / 2 ? 64 : 192, 3);
}

static void speckled(int x, int y, unsigned char rgb[3])
{
	grey(x, y, rgb);
	if (x == SIDE / 2 && y == SIDE / 2)
		memset(rgb, 255, 3);
}

static void test_flip_of_flat_pictures(void **state)
{
	(void)state;
	static float map[SIDE * SIDE];
	flip_of(grey, grey, FLIP_PIXELS_PER_DEGREE, map);
	assert_true(map[0] == 0 && map[SIDE * SIDE / 2] == 0);
	/* Black and white differ by 100 in lightness; 41.2760 is the largest difference to the power of 0.7, that of green and blue. */
	const double knee = 0.4 * 41.2760, expected = 0.95 + (pow(100, 0.7) - knee) / (41.2760 - knee) * 0.05;
	flip_of(black, white, FLIP_PIXELS_PER_DEGREE, map);
	for (int i = 0; i < SIDE * SIDE; i++)
		assert_true(fabs((double)map[i] - expected) < 2e-4);
	flip_of(green, blue, FLIP_PIXELS_PER_DEGREE, map);
	assert_true(fabs((double)map[0] - 1) < 2e-4);
}

/* Wherever it is given up, it says so; it is asked in all of its steps. */
static void test_flip_is_given_up(void **state)
{
	(void)state;
	static unsigned char codes[3 * SIDE * SIDE];
	struct flip_picture picture;
	int asked = 0;
	paint(grey, codes);
	for (bool done = false; !done; asked++) {
		int left = asked;
		done = flip_picture_init(&picture, codes, SIDE, SIDE, 20, count_down, &left);
		flip_picture_finish(&picture);
		assert_true(done == (left >= 0));
	}
	assert_in_range(asked, 12, 100);
}

static void test_flip_is_symmetric(void **state)
{
	(void)state;
	static float one[SIDE * SIDE], other[SIDE * SIDE];
	flip_of(half, grey, FLIP_PIXELS_PER_DEGREE, one);
	flip_of(grey, half, FLIP_PIXELS_PER_DEGREE, other);
	for (int i = 0; i < SIDE * SIDE; i++) {
		assert_true(fabsf(one[i] - other[i]) < 1e-6f);
		assert_true(one[i] >= 0 && one[i] <= 1);
	}
}

/* What is too fine to be seen does not count: a pattern of single pixels is grey (0.5, the code 188) at 1000 pixels a degree, and a pattern
 * at 5. */
static void light_grey(int x, int y, unsigned char rgb[3])
{
	(void)x, (void)y;
	memset(rgb, 188, 3);
}

static void test_flip_blurs_what_is_far(void **state)
{
	(void)state;
	static float far[SIDE * SIDE], near[SIDE * SIDE];
	const int middle = SIDE * SIDE / 2 + SIDE / 2;
	flip_of(checks, light_grey, 1000, far);
	flip_of(checks, light_grey, 5, near);
	assert_true(far[middle] < 0.05f);
	assert_true(near[middle] > 0.5f);
}

/* A firefly is a feature: it counts more than its colour, blurred by the eye, alone would. */
static void test_flip_sees_points(void **state)
{
	(void)state;
	static float map[SIDE * SIDE];
	flip_of(grey, speckled, FLIP_PIXELS_PER_DEGREE, map);
	assert_true(map[SIDE * SIDE / 2 + SIDE / 2] > 0.05f);
	assert_true(map[0] < 1e-3f);
}

/* --- false colours
 * ------------------------------------------------------------------------------------------------------------------------ */

static double lightness(const unsigned char rgb[3])
{
	double linear[3];
	for (int c = 0; c < 3; c++)
		linear[c] = pow(rgb[c] / 255.0, 2.2);
	return cbrt(0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]);
}

static void test_false_colours_grow_lighter(void **state)
{
	(void)state;
	double last = -1;
	for (int i = 0; i <= 32; i++) {
		unsigned char rgb[3];
		false_colour_magma((float)i / 32, rgb);
		assert_true(lightness(rgb) > last);
		last = lightness(rgb);
	}
	unsigned char low[3], none[3], high[3];
	false_colour_diverging(-5, low);
	false_colour_diverging(0, none);
	false_colour_diverging(1, high);
	assert_true(low[2] > low[0] + 100 && high[0] > high[2] + 100);
	assert_true(none[0] == none[1] && none[1] == none[2]);
	assert_true(lightness(none) > lightness(low) && lightness(none) > lightness(high));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_difference_of_known_pixels),
		cmocka_unit_test(test_difference_is_relative_and_tells_channels),
		cmocka_unit_test(test_nothing_has_no_figures),
		cmocka_unit_test(test_noise_is_taken_out),
		cmocka_unit_test(test_no_more_is_taken_out_than_there_is),
		cmocka_unit_test(test_develop_codes),
		cmocka_unit_test(test_flip_of_flat_pictures),
		cmocka_unit_test(test_flip_is_given_up),
		cmocka_unit_test(test_flip_is_symmetric),
		cmocka_unit_test(test_flip_blurs_what_is_far),
		cmocka_unit_test(test_flip_sees_points),
		cmocka_unit_test(test_false_colours_grow_lighter),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
