// Thickness of the cloud layer at a place: interpolated field, detail, and only then the threshold, whose softness follows the footprint of the pixel.
#ifndef SHADERS_LIB_FIELD
#define SHADERS_LIB_FIELD
#include "shaders/lib/scene_block.glsl"

#ifndef __cplusplus
uniform sampler2D field_coarse;
uniform sampler2D field_detail;
#endif

// Excess density, over its range, at which the edge of a cloud has half the thickness that its middle would have.
const float FIELD_SKIRT = 0.06;

// Cubic B-spline interpolation of a repeating texture out of four bilinear samples (Sigg and Hadwiger, GPU Gems 2, chapter 20).
float field_bicubic(sampler2D field, vec2 uv, float size, float lod)
{
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
	float a = mix(textureLod(field, vec2(h1.x, h0.y), lod).x, textureLod(field, h0, lod).x, g0.x);
	float b = mix(textureLod(field, h1, lod).x, textureLod(field, vec2(h0.x, h1.y), lod).x, g0.x);
	return mix(b, a, g0.y);
}

// The field before its threshold. place: metres east and north of the tile's corner; footprint: size of the pixel there, m.
float field_density(vec2 place, float footprint)
{
	vec2 p = place - vec2(cloud_drift.x, cloud_drift.y);
	float texel = cloud_layer.z / cloud_threshold.w;
	float lod = max(0.0, log2(footprint / texel));
	// From the second level on, the spline would only blur what is already small: size of the level's texels.
	float size = cloud_threshold.w * exp2(-floor(lod));
	float density = field_bicubic(field_coarse, p / cloud_layer.z, size, lod);
	float relative = footprint * (1.0 / 30.0);
	float fade = cloud_detail.w / (1.0 + relative * relative);
	if (fade > 0.004)
		density += fade * textureLod(field_detail, (p - vec2(cloud_detail.y, cloud_detail.z)) / cloud_detail.x,
		                             max(0.0, log2(footprint * 512.0 / cloud_detail.x))).x;
	return density;
}

// Thickness H in m, 0..maximum, of a density. The threshold is softened (softplus) over what the footprint hides.
float field_thickness_of(float density, float footprint)
{
	float excess = (density - cloud_threshold.x) * cloud_threshold.y;
	float softness = 0.012 + 0.05 * (1.0 - exp(-footprint * (1.0 / 150.0)));
	float x = excess / softness;
	float soft = x > 20.0 ? excess : x < -12.0 ? 0.0 : softness * log(1.0 + exp(x));
	// A thin skirt around a thick middle: edges are translucent over some 100 m.
	return cloud_layer.y * min(pow(soft, cloud_threshold.z) * soft / (soft + FIELD_SKIRT), 1.0);
}

float field_thickness(vec2 place, float footprint)
{
	return cloud_layer.w < 0.5 ? 0.0 : field_thickness_of(field_density(place, footprint), footprint);
}
#endif
