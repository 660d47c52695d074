#include "renderer/image/develop.h"

#include <math.h>

static float luminance_of(const float rgb[3])
{
	return 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
}

/* The functions below, and their constants, are those of shaders/lib/colour.glsl, where they are explained. */

static void draw_into_gamut(float rgb[3])
{
	const float luminance = fmaxf(luminance_of(rgb), 0), lowest = fminf(rgb[0], fminf(rgb[1], rgb[2]));
	if (lowest >= 0)
		return;
	const float share = luminance / fmaxf(luminance - lowest, 1e-9f);
	for (int c = 0; c < 3; c++)
		rgb[c] = fmaxf(luminance + share * (rgb[c] - luminance), 0);
}

static float filmic(float x)
{
	const float z = 1 / sqrtf(1 + (1.25f / 1.5f) * powf(x, 1.15f)), rest = (1 - z) * (1 - z);
	return 1 - z * (z * z + 0.5f * rest * rest);
}

static void expose_film(float rgb[3])
{
	static const float balance[3] = {0.93f, 1.015f, 1.10f};
	for (int c = 0; c < 3; c++)
		rgb[c] *= balance[c];
	const float red = rgb[0], square = red * red, fog = 0.002f;
	const float share = square * (0.85f + 0.0033f * red) / ((square + 9) * (1 + 0.005f * red));
	for (int c = 0; c < 3; c++) {
		const float lack = fmaxf(1 - rgb[c] / fmaxf(red, 1e-9f), 0);
		rgb[c] = filmic(rgb[c] + fog * red) * (1 - share * lack * (0.45f + 0.55f * lack * lack));
	}
}

/* IEC 61966-2-1. */
static float srgb(float x)
{
	return x <= 0.0031308f ? 12.92f * x : 1.055f * powf(x, 1 / 2.4f) - 0.055f;
}

void develop_picture(const float *pixels, size_t count, double exposure_ev, enum tone tone, unsigned char *codes)
{
	const float exposure = (float)exp2(exposure_ev);
	for (size_t i = 0; i < count; i++, pixels += 3, codes += 3) {
		float rgb[3] = {pixels[0], pixels[1], pixels[2]};
		draw_into_gamut(rgb);
		for (int c = 0; c < 3; c++)
			rgb[c] *= exposure;
		if (tone == TONE_FILMIC)
			expose_film(rgb);
		for (int c = 0; c < 3; c++)
			codes[c] = (unsigned char)lrintf(255 * fminf(fmaxf(srgb(rgb[c]), 0), 1));
	}
}
