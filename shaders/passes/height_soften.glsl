// The height field's surface as it is looked up: x, y slopes to the east and to the north; z height above which there is no shadow, at least that of the top, m;
// w what light that is scattered often has received, relative to a horizontal plane: spread sideways over squares of two sizes, arguments[0].x and .y, m, with the weight .z of the first, and with the flux that the beams bring.
// 1: the same of light that is scattered a few times and comes out near where it went in: over a square of arguments[0].w, m.
#include "shaders/lib/bicubic.glsl"
#include "shaders/lib/height_sun.glsl"

#ifndef __cplusplus
uniform sampler2D received_table;
#endif

vec2 spread_level(vec2 uv, float level)
{
	bicubic_samples s = bicubic_at(uv, HEIGHT_SIZE_LIGHT * exp2(-level));
	vec2 a = mix(vec2(textureLod(received_table, vec2(s.far.x, s.near.y), level)), vec2(textureLod(received_table, s.near, level)), s.share.x);
	vec2 b = mix(vec2(textureLod(received_table, s.far, level)), vec2(textureLod(received_table, vec2(s.near.x, s.far.y), level)), s.share.x);
	return mix(b, a, s.share.y);
}

// Received over caught light, both spread out over a length. The spline itself is as wide as a box of two texels.
float spread_over(vec2 uv, float length_m)
{
	float lod = max(0.0, log2(length_m * HEIGHT_SIZE_LIGHT / cloud_layer.z) - 1.0);
	vec2 sums = mix(spread_level(uv, floor(lod)), spread_level(uv, floor(lod) + 1.0), fract(lod));
	return (sums.x + 1e-3) / (sums.y + 1e-3);
}

void pass(ivec2 pixel)
{
	vec2 uv = (vec2(pixel) + 0.5) / HEIGHT_SIZE_LIGHT;
	vec3 mean = vec3(textureLod(received_table, vec2(0.5), log2(HEIGHT_SIZE_LIGHT)));
	float flux = mean.z / max(mean.x, 1e-6);
	float received = mix(spread_over(uv, arguments[0].y), spread_over(uv, arguments[0].x), arguments[0].z);
	// Differences over less than a mean free path are nothing that light sees.
	vec2 slope = height_slope(uv * cloud_layer.z + vec2(cloud_drift.x, cloud_drift.y), 0.75 * cloud_layer.z / HEIGHT_SIZE_LIGHT);
	STORE(0, vec4(slope, texelFetch(received_table, pixel, 0).w, received * flux));
	STORE(1, vec4(spread_over(uv, arguments[0].w) * flux));
}
