// From the three bands to linear Rec.709, and on to what a screen shows.
#include "shaders/lib/noise.glsl"

// Radiance in the bands (650, 550, 450 nm; W/m2/nm/sr) to linear Rec.709 with (1,1,1) = 1000 cd/m2.
vec3 colour_of_bands(vec3 bands)
{
	return vec3(band_red) * bands.x + vec3(band_green) * bands.y + vec3(band_blue) * bands.z;
}

// The filmic curve, a channel at a time: a straight part through the shadows and middle greys, then a shoulder that reaches 1 only at infinity,
// (x + a x^2) / (1 + b x + a x^2). Slope 1 at the origin times the exposure.
float colour_filmic(float x)
{
	return x * (1.35 + 1.9 * x) / (1.0 + x * (1.75 + 1.9 * x));
}

// Rec.709 colours outside the gamut are drawn to grey until no channel is negative, which keeps their luminance.
vec3 colour_into_gamut(vec3 rgb)
{
	float luminance = max(dot(rgb, vec3(0.2126, 0.7152, 0.0722)), 0.0);
	float lowest = min(rgb.x, min(rgb.y, rgb.z));
	if (lowest >= 0.0)
		return rgb;
	return max(mix(vec3(luminance), rgb, luminance / max(luminance - lowest, 1e-9)), vec3(0.0));
}

// IEC 61966-2-1.
float colour_srgb(float x)
{
	return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1.0 / 2.4) - 0.055;
}

// Triangular noise of one code either side, fixed to the pixel, which hides the steps of 8 bits in a smooth sky.
vec3 colour_dither(ivec2 pixel)
{
	uint h = noise_hash2(pixel.x, pixel.y, 5u);
	uint k = noise_hash(h);
	return vec3(noise_unit(h) + noise_unit(k), noise_unit(noise_hash(k)) + noise_unit(noise_hash(h + 1u)),
	            noise_unit(noise_hash(k + 1u)) + noise_unit(noise_hash(h + 2u))) - 1.0;
}
