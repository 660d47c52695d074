// Puffs on the height field about as large as its texels and finer, for cameras close to it.
#ifndef SHADERS_LIB_HEIGHT_DETAIL
#define SHADERS_LIB_HEIGHT_DETAIL
#include "shaders/lib/height.glsl"

#ifndef __cplusplus
uniform sampler2D field_detail; // turbulence in standard deviations
#endif

// Of a thick cloud, m; nothing is left of them beyond the second distance, where the field's texels are pixels.
const float HEIGHT_PUFF = 22.0;
const vec2 HEIGHT_PUFF_DISTANCES = vec2(400.0, 1500.0);
// Largest height of a puff over its mean, relative to HEIGHT_PUFF.
const float HEIGHT_PUFF_TOP = 0.9;
// The turbulence's picture is used this much smaller than below the layer, and nothing of it that is finer than light sees in droplets, m.
const float HEIGHT_PUFF_SCALE = 1.0;
const float HEIGHT_PUFF_FINEST = 18.0;

// Puffs with creases between them, where the turbulence changes its sign. Mean about 0.
float height_puff(vec2 place, float footprint)
{
	vec2 p = place - vec2(cloud_drift.x, cloud_drift.y) - vec2(cloud_detail.y, cloud_detail.z);
	float scale = HEIGHT_PUFF_SCALE / cloud_detail.x;
	float x = textureLod(field_detail, p * scale, max(log2(max(footprint, HEIGHT_PUFF_FINEST) * 512.0 * scale), 0.0)).x;
	return min(sqrt(x * x + 0.05), 0.75 + HEIGHT_PUFF_TOP) - 0.75;
}

// Height of the puffs, m, on cloud of some thickness.
float height_puff_depth(float thickness, float t)
{
	return HEIGHT_PUFF * thickness / (thickness + 80.0) * (1.0 - smoothstep(HEIGHT_PUFF_DISTANCES.x, HEIGHT_PUFF_DISTANCES.y, t));
}
#endif
