// Exchange of diffuse light between the cloud base and the ground, parallel planes of one periodic tile.
//
// The kernel between them, h^2 / (pi (h^2 + d^2)^2), is a sum of smooth kernels of growing size: cubic B-splines on the levels of a mip pyramid, whose weights
// the processor fits to the kernel's transform (renderer/stages/exchange_weights.h). They sum to 1: nothing is created or lost.
#ifndef SHADERS_LIB_RADIOSITY
#define SHADERS_LIB_RADIOSITY
#include "shaders/lib/field.glsl"

const int EXCHANGE_LEVELS = 8;

vec3 exchange_bicubic(sampler2D plane, vec2 uv, float level)
{
	float size = exp2(7.0 - level); // planes are 128 texels a side
	vec2 p = uv * size - 0.5;
	vec2 base = floor(p);
	vec2 f = p - base;
	vec2 f2 = f * f;
	vec2 f3 = f2 * f;
	vec2 w0 = (1.0 - 3.0 * f + 3.0 * f2 - f3) * (1.0 / 6.0);
	vec2 w1 = (4.0 - 6.0 * f2 + 3.0 * f3) * (1.0 / 6.0);
	vec2 w3 = f3 * (1.0 / 6.0);
	vec2 g0 = w0 + w1;
	vec2 h0 = (base + w1 / g0 - 0.5) / size;
	vec2 h1 = (base + 1.5 + w3 / (1.0 - g0)) / size;
	vec3 a = mix(vec3(textureLod(plane, vec2(h1.x, h0.y), level)), vec3(textureLod(plane, h0, level)), g0.x);
	vec3 b = mix(vec3(textureLod(plane, h1, level)), vec3(textureLod(plane, vec2(h0.x, h1.y), level)), g0.x);
	return mix(b, a, g0.y);
}

// Irradiance received at uv from the other plane's radiosity. arguments[0], [1]: weights, finest level first; [2]: the first and the last level with any weight.
vec3 exchange_received(sampler2D plane, vec2 uv)
{
	const int MEAN = EXCHANGE_LEVELS - 1; // the level of one texel
	vec3 sum = arguments[1].w * vec3(texelFetch(plane, ivec2(0), MEAN));
	int last = min(int(arguments[2].y), MEAN - 1);
	for (int level = int(arguments[2].x); level <= last; level++)
		sum += arguments[level / 4][level - level / 4 * 4] * exchange_bicubic(plane, uv, float(level));
	return sum;
}
#endif
