// Exchange of diffuse light between the cloud base and the ground, parallel planes of one periodic tile.
//
// The kernel between them, h^2 / (pi (h^2 + d^2)^2), is a sum of smooth kernels of growing size: cubic B-splines on the levels of a pyramid (shaders/passes/radiosity_reduce.glsl), whose weights
// the processor fits to the kernel's transform (renderer/stages/exchange_weights.h). They sum to 1: nothing is created or lost.
#ifndef SHADERS_LIB_RADIOSITY
#define SHADERS_LIB_RADIOSITY
#include "shaders/lib/field.glsl"

const int EXCHANGE_LEVELS = 8;

vec3 exchange_bicubic(sampler2D plane, vec2 uv, float level)
{
	bicubic_samples s = bicubic_at(uv, exp2(7.0 - level)); // planes are 128 texels a side
	vec3 a = mix(vec3(textureLod(plane, vec2(s.far.x, s.near.y), level)), vec3(textureLod(plane, s.near, level)), s.share.x);
	vec3 b = mix(vec3(textureLod(plane, s.far, level)), vec3(textureLod(plane, vec2(s.near.x, s.far.y), level)), s.share.x);
	return mix(b, a, s.share.y);
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
