// Thickness of the cloud layer at a place: interpolated field, detail, and only then the threshold, whose softness follows the footprint of the pixel.
#ifndef SHADERS_LIB_FIELD
#define SHADERS_LIB_FIELD
#include "shaders/lib/bicubic.glsl"
#include "shaders/lib/packed.glsl"
#include "shaders/lib/scene_block.glsl"

#ifndef __cplusplus
uniform sampler2D field_coarse;
uniform sampler2D field_detail;
#endif

// Excess density, over its range, at which the edge of a cloud has half the thickness that its middle would have.
const float FIELD_SKIRT = 0.06;

float field_bicubic(sampler2D field, vec2 uv, float size, float lod)
{
	bicubic_samples s = bicubic_at(uv, size);
	float a = mix(textureLod(field, vec2(s.far.x, s.near.y), lod).x, textureLod(field, s.near, lod).x, s.share.x);
	float b = mix(textureLod(field, s.far, lod).x, textureLod(field, vec2(s.near.x, s.far.y), lod).x, s.share.x);
	return mix(b, a, s.share.y);
}

// Texels of the detail's side.
const int FIELD_DETAIL_SIZE = 512;

// Both pictures at a place in their tiles, at a footprint of 2^lod texels. FIELD_PACKED: the samplers hold them packed (shaders/lib/packed.glsl);
// FIELD_NEAR: no footprint is larger than a texel of the field, or of the thickness evened out.
float field_coarse_at(vec2 uv, float lod)
{
#if defined(FIELD_PACKED) && defined(FIELD_NEAR)
	return packed_spline(field_coarse, uv, int(cloud_threshold.w), 0);
#elif defined(FIELD_PACKED)
	return packed_spline_between(field_coarse, uv, int(cloud_threshold.w), lod);
#else
	// From the second level on, the spline would only blur what is already small: size of the level's texels.
	return field_bicubic(field_coarse, uv, cloud_threshold.w * exp2(-floor(lod)), lod);
#endif
}

float field_detail_at(vec2 uv, float lod)
{
#ifdef FIELD_PACKED
	return packed_linear_between(field_detail, uv, FIELD_DETAIL_SIZE, lod);
#else
	return textureLod(field_detail, uv, lod).x;
#endif
}

// The field before its threshold. place: metres east and north of the tile's corner; footprint: size of the pixel there, m.
float field_density(vec2 place, float footprint)
{
	vec2 p = place - vec2(cloud_drift.x, cloud_drift.y);
	float texel = cloud_layer.z / cloud_threshold.w;
	float lod = max(0.0, log2(footprint / texel));
	float density = field_coarse_at(p / cloud_layer.z, lod);
	float relative = footprint * (1.0 / 30.0);
	float fade = cloud_detail.w / (1.0 + relative * relative);
	if (fade > 0.004)
		density += fade * field_detail_at((p - vec2(cloud_detail.y, cloud_detail.z)) / cloud_detail.x,
		                                  max(0.0, log2(footprint * float(FIELD_DETAIL_SIZE) / cloud_detail.x)));
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
