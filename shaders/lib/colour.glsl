// From the three bands to linear Rec.709, and on to what a screen shows.
#ifndef SHADERS_LIB_COLOUR
#define SHADERS_LIB_COLOUR
#include "shaders/lib/noise.glsl"

// Radiance in the bands (650, 550, 450 nm; W/m2/nm/sr) to linear Rec.709 with (1,1,1) = 1000 cd/m2.
vec3 colour_of_bands(vec3 bands)
{
	return vec3(band_red) * bands.x + vec3(band_green) * bands.y + vec3(band_blue) * bands.z;
}

// Film for daylight takes warmer light for white than Rec.709 does, which is white at 6500 K: factors that make light of some 5900 K white, between the sun's and that of the whole
// sky, so that sunlit cloud keeps a trace of the sun's warmth and a grey sky a trace of blue. Pictures in files of scene light (EXR), and the linear tone, stay colorimetric.
const vec3 COLOUR_FILM_BALANCE = vec3(0.93, 1.015, 1.10);

// x^1.15 for x >= 0 within 1.3e-4 of itself, which is 0.02 of a code of 8 bits after the curve below: 2^(0.15 e) times m^0.15 for x = 2^e m, by cubics that are fitted
// to the least relative error. Powers by logarithms are dear on a processor.
float colour_power_near(float x)
{
	int bits = floatBitsToInt(x);
	float turns = 0.15 * (float(bits >> 23) - 127.0);
	float m = intBitsToFloat((bits & 0x7fffff) | 0x3f800000);
	float whole = floor(turns);
	float rest = turns - whole;
	float of_m = 0.78597911 + m * (0.29373958 + m * (m * 0.01371066 - 0.09337976));
	float of_rest = 0.99992522 + rest * (0.69583354 + rest * (0.22606716 + rest * 0.07802452));
	return x * of_m * of_rest * intBitsToFloat((int(whole) + 127) << 23);
}

// Decided when the shader is built: is this for codes of 8 bits?
#ifndef COLOUR_NEAR
#define COLOUR_NEAR 0
#endif

// The filmic curve, a channel at a time: 1 - z^3 - w z (1 - z)^4 with z = (1 + a x^c)^(-1/2). The exponent c makes shadows and middle greys a little steeper than linear, as film is.
// Middle grey 0.18 comes out at 0.15, twice white (2.0) at 0.78. From there the second term bears a long shoulder, of a slope that hardly matters below: 0.91 at five
// times white, 0.96 at forty, 0.99 at a thousand, and white itself only at infinity, so that the sun's disc stands out of its aureole and a silver lining has grades.
float colour_filmic(float x)
{
#if COLOUR_NEAR
	float power = colour_power_near(x);
#else
	float power = pow(x, 1.15);
#endif
	float z = inversesqrt(1.0 + (1.25 / 1.5) * power);
	float rest = (1.0 - z) * (1.0 - z);
	return 1.0 - z * (z * z + 0.5 * rest * rest);
}

// By the curve alone all channels of light far beyond white end alike, white whatever its hue, the disc of a setting sun too. Warm light goes to a tint of its own hue instead: a
// channel loses by what it lacks to the red one, the more from middle greys to ten times white, where the light round a low sun is, and a little less
// beyond, so that the disc is paler than its aureole. Not even that light is of one colour alone (COLOUR_FILM_FOG). Cool light, as in a corona, goes to white.
const float COLOUR_FILM_FOG = 0.002;

vec3 colour_filmic_hue(vec3 rgb)
{
	float square = rgb.x * rgb.x;
	float share = square * (0.85 + 0.0033 * rgb.x) / ((square + 9.0) * (1.0 + 0.005 * rgb.x));
	vec2 lack = max(vec2(1.0) - vec2(rgb.y, rgb.z) * (1.0 / max(rgb.x, 1e-9)), vec2(0.0));
	vec2 kept = vec2(1.0) - share * lack * (vec2(0.45) + 0.55 * lack * lack);
	rgb += COLOUR_FILM_FOG * rgb.x;
	return vec3(colour_filmic(rgb.x), kept * vec2(colour_filmic(rgb.y), colour_filmic(rgb.z)));
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

// The same by roots alone, for x >= 0: within 3.2e-5, a hundredth of a code of 8 bits. Powers are dear on a processor.
float colour_srgb_near(float x)
{
	float r2 = sqrt(x);
	float r4 = sqrt(r2);
	float r8 = sqrt(r4);
	return x <= 0.0031308 ? 12.92 * x : 0.65398335 * r2 + 0.68871564 * r4 - 0.31847588 * r8 - 0.0201874 * x - 0.00406698;
}

// Triangular noise of one code either side, fixed to the pixel, which hides the steps of 8 bits in a smooth sky.
vec3 colour_dither(ivec2 pixel)
{
	uint h = noise_hash2(pixel.x, pixel.y, 5u);
	uint k = noise_hash(h);
	// Three numbers of ten bits out of each hash.
	vec3 sum = vec3(float((h & 1023u) + (k & 1023u)), float((h >> 10u & 1023u) + (k >> 10u & 1023u)), float((h >> 20u & 1023u) + (k >> 20u & 1023u)));
	return (sum + 1.0) * (1.0 / 1024.0) - 1.0;
}
#endif
