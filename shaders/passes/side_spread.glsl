// The light of columns spread sideways, as it is looked up: x thickness evened out, m; y, z light scattered often at the base and at the sides; w as it came.
// arguments[0]: two lengths, m, weight of the first; texels a side.
#include "shaders/lib/bicubic.glsl"
#include "shaders/lib/side_light.glsl"

uniform sampler2D columns;

vec4 spread_level(vec2 uv, float level)
{
	bicubic_samples s = bicubic_at(uv, arguments[0].w * exp2(-level));
	vec4 a = mix(textureLod(columns, vec2(s.far.x, s.near.y), level), textureLod(columns, s.near, level), s.share.x);
	vec4 b = mix(textureLod(columns, s.far, level), textureLod(columns, vec2(s.near.x, s.far.y), level), s.share.x);
	return mix(b, a, s.share.y);
}

// The spline itself is as wide as a box of two texels.
vec4 spread_over(vec2 uv, float length_m)
{
	float lod = max(0.0, log2(length_m * arguments[0].w / cloud_layer.z) - 1.0);
	return mix(spread_level(uv, floor(lod)), spread_level(uv, floor(lod) + 1.0), fract(lod));
}

void pass(ivec2 pixel)
{
	vec2 uv = (vec2(pixel) + 0.5) / arguments[0].w;
	vec4 far = spread_over(uv, arguments[0].y);
	vec4 near = spread_over(uv, arguments[0].x);
	float share = arguments[0].z;
	vec4 sums = mix(far, near, share);
	STORE(0, vec4(sums.z, vec2(sums.x, sums.y) / sums.z, texelFetch(columns, pixel, 0).w));
}
