// Thickness of the cloud layer at a place: interpolated field, detail, and only then the threshold, whose softness follows the footprint of the pixel.
#ifndef SHADERS_LIB_FIELD
#define SHADERS_LIB_FIELD
#include "shaders/lib/bicubic.glsl"
#include "shaders/lib/field_warp.glsl"
#include "shaders/lib/packed.glsl"
#include "shaders/lib/scene_block.glsl"

#ifndef __cplusplus
uniform sampler2D field_coarse;
uniform sampler2D field_detail;
#endif

// A tile of detail is this many times finer than the field, or the tile of detail, above it.
const float FIELD_DETAIL_STEP = 8.0;

// octaves: by which a pixel is larger than a texel. Splines are for texels larger than pixels. They are read as level 0 alone, since their samples fit its
// texels, and run together to one point as texels and pixels become equal; further levels are for smaller texels.
float field_bicubic(sampler2D field, vec2 uv, float size, float octaves)
{
	bicubic_samples s = bicubic_at(uv, size);
	float lod = max(octaves, 0.0);
	float spread = clamp(-octaves, 0.0, 1.0);
	s.near = mix(uv, s.near, spread);
	s.far = mix(uv, s.far, spread);
	float a = mix(textureLod(field, vec2(s.far.x, s.near.y), lod).x, textureLod(field, s.near, lod).x, s.share.x);
	float b = mix(textureLod(field, s.far, lod).x, textureLod(field, vec2(s.near.x, s.far.y), lod).x, s.share.x);
	return mix(b, a, s.share.y);
}

// Texels of the detail's side.
const int FIELD_DETAIL_SIZE = 512;

// Both pictures at a place in their tiles, seen by a pixel that is larger than a texel by so many octaves. FIELD_PACKED: the samplers hold them packed
// (shaders/lib/packed.glsl); FIELD_NEAR: all pixels are smaller than half a texel of the field.
float field_coarse_at(vec2 uv, float octaves)
{
#if defined(FIELD_PACKED) && defined(FIELD_NEAR)
	return packed_spline(field_coarse, uv, int(cloud_threshold.w));
#elif defined(FIELD_PACKED)
	int side = int(cloud_threshold.w);
	return mix(packed_linear_between(field_coarse, uv, side, octaves), packed_spline(field_coarse, uv, side), clamp(-octaves, 0.0, 1.0));
#else
	return field_bicubic(field_coarse, uv, cloud_threshold.w, octaves);
#endif
}

float field_detail_at(vec2 uv, float octaves)
{
#ifdef FIELD_PACKED
	return packed_linear_between(field_detail, uv, FIELD_DETAIL_SIZE, octaves);
#else
	return textureLod(field_detail, uv, max(0.0, octaves)).x;
#endif
}

// Octaves by which the footprint is larger than a texel of the field.
float field_octaves(float footprint)
{
	return log2(footprint * cloud_threshold.w / cloud_layer.z);
}

// Where detail is read at a place p in the drifting field: elsewhere where the density is another, so that its repeat does not show.
vec2 field_detail_place(vec2 p, float density)
{
	return (p - vec2(cloud_detail.y, cloud_detail.z) + cloud_field.y * density * vec2(1.0, 0.6)) / cloud_detail.x;
}

// How many tiles of detail there are, where that is decided when the shader is built: software renderers hold everything in memory across a loop,
// and run through it once even where it is to run not at all.
#ifndef FIELD_DETAIL_TILES
#define FIELD_DETAIL_TILES int(cloud_field.z)
#endif

// Sum of the tiles of detail at a place p in the drifting field.
float field_detail_sum(vec2 p, float density, float octaves)
{
	vec2 uv = field_detail_place(p, density);
	float sum = field_detail_at(uv, octaves + 3.0);
	float weight = 0.5;
	for (int i = 1; i < FIELD_DETAIL_TILES; i++) {
		uv *= FIELD_DETAIL_STEP;
		sum += weight * field_detail_at(uv, octaves + 6.0);
		weight *= 0.5;
		octaves += 3.0;
	}
	return sum;
}

// Sides of clouds billow on scales that neither the field's texels nor means along a slanted view show: by how much they are met elsewhere, m. The detail serves once more, so large that
// its octaves begin at 160 m, in two places a whole number of texels apart; on thick layers it is the rougher. Pixels are hardly larger than its texels wherever sides are told.
const float FIELD_RUGGED_TILE = 1e4;   // m, about: a whole number of them is a tile
const float FIELD_RUGGED_APART = 0.40625;
const float FIELD_RUGGED_SHARE = 0.1;  // of the layer's thickness
const float FIELD_RUGGED_MOST = 45.0;  // m

vec2 field_rugged(vec2 place)
{
	vec2 uv = field_place(place) * (max(floor(cloud_layer.z / FIELD_RUGGED_TILE + 0.5), 1.0) / cloud_layer.z);
#ifdef FIELD_PACKED
	float size = float(FIELD_DETAIL_SIZE);
	vec2 p = uv * size - 0.5;
	vec2 base = floor(p);
	vec2 f = p - base;
	base = (base + 0.5) / size;
	vec4 a = packed_texel(field_detail, fract(base), FIELD_DETAIL_SIZE, size);
	vec4 b = packed_texel(field_detail, fract(base + FIELD_RUGGED_APART), FIELD_DETAIL_SIZE, size);
	vec2 shift = mix(mix(vec2(a.x, b.x), vec2(a.y, b.y), f.x), mix(vec2(a.z, b.z), vec2(a.w, b.w), f.x), f.y);
#else
	vec2 shift = vec2(textureLod(field_detail, uv, 0.0).x, textureLod(field_detail, uv + FIELD_RUGGED_APART, 0.0).x);
#endif
	return min(FIELD_RUGGED_SHARE * cloud_layer.y, FIELD_RUGGED_MOST) * shift;
}

// The field alone, where pixels are larger than texels. p: place in the drifting field.
float field_far_at(vec2 p, float octaves)
{
	vec2 uv = p / cloud_layer.z;
#ifdef FIELD_PACKED
	return packed_linear_between(field_coarse, uv, int(cloud_threshold.w), octaves);
#else
	return textureLod(field_coarse, uv, max(octaves, 0.0)).x;
#endif
}

// The field before its threshold. place: metres east and north of the tile's corner; octaves: field_octaves.
float field_density_at(vec2 place, float octaves)
{
	vec2 p = field_place(place);
	float density = field_coarse_at(p / cloud_layer.z, octaves);
	return density + cloud_detail.w * field_detail_sum(p, density, octaves);
}

// footprint: size of the pixel there, m.
float field_density(vec2 place, float footprint)
{
	return field_density_at(place, field_octaves(footprint));
}

// The threshold is softened over what the footprint hides: over so much to either side, in shares of the range above it.
float field_softness(float octaves)
{
	// What is finer than the footprint varies as its cubic root, with the spectrum k^(-8/3).
	float hidden = exp2(min(octaves + 1.0, 5.0) * (1.0 / 3.0));
	return 0.003 + 0.8 * cloud_detail.w * cloud_threshold.y * hidden;
}

// Thickness H in m, 0..maximum, of a density.
float field_thickness_soft(float density, float softness)
{
	float excess = (density - cloud_threshold.x) * cloud_threshold.y;
	// Mean of what is above the threshold, of values spread evenly by the softness to either side.
	float above = max(excess + softness, 0.0);
	float soft = excess > softness ? excess : above * above / (4.0 * softness);
	// A thin skirt around a thick middle: edges are translucent over some 100 m. A map says itself how thick its clouds are.
	float share = (1.0 - pow(max(1.0 - soft, 0.0), cloud_threshold.z)) * soft * (1.0 + cloud_field.x) / (soft + cloud_field.x);
	return cloud_layer.y * clamp(cloud_threshold.z > 0.0 ? share : density, 0.0, 1.0);
}

float field_thickness_of(float density, float footprint)
{
	return field_thickness_soft(density, field_softness(field_octaves(footprint)));
}

// The same for a shadow, whose penumbra hides the detail and which is seen at a slant: no spline, but two levels whose texels blur as much.
float field_thickness_shadow(vec2 place, float footprint)
{
	float lod = max(0.6, log2(footprint * cloud_threshold.w / cloud_layer.z));
	vec2 uv = field_place(place) / cloud_layer.z;
#ifdef FIELD_PACKED
	float density = packed_linear_between(field_coarse, uv, int(cloud_threshold.w), lod);
#else
	float density = textureLod(field_coarse, uv, lod).x;
#endif
	return field_thickness_of(density, footprint);
}

// Along the horizon a pixel covers a long strip of the layer, over which light is averaged, not thickness: single thicknesses would come out as bars. Below this cosine of
// the view to the vertical the strip is taken in parts; twice as flat, in full.
const float FIELD_ALONG_COSINE = 0.12;
const int FIELD_ALONG_PARTS = 4;

// What a pixel sees of the layer over its strip. x: the thickness that lets as much through as the strip does on the whole; y: mean thickness where there is cloud. mu_v: cosine of
// the view to the vertical; heading: of the view, any length; extinction_per_m: of the light that is averaged.
vec2 field_thickness_along(vec2 place, vec2 heading, float footprint, float mu_v, float extinction_per_m)
{
	// camera_footprint is as much longer than the pixel is wide as the strip is longer than it.
	float flatness = 1.0 - smoothstep(0.5 * FIELD_ALONG_COSINE, FIELD_ALONG_COSINE, mu_v);
	float strip = flatness * footprint * inversesqrt(mu_v);
	vec2 part = heading * inversesqrt(max(dot(heading, heading), 1e-12)) * (strip / float(FIELD_ALONG_PARTS));
	float octaves = field_octaves(max(footprint, strip / float(FIELD_ALONG_PARTS)));
	float softness = field_softness(octaves);
	vec2 p = field_place(place);
	float detail = cloud_detail.w * field_detail_sum(p, field_far_at(p, octaves), octaves);
	vec4 thickness;
	for (int i = 0; i < FIELD_ALONG_PARTS; i++) {
		vec2 at = p + part * (float(i) - 0.5 * float(FIELD_ALONG_PARTS - 1));
		thickness[i] = field_thickness_soft(field_far_at(at, octaves) + detail, softness);
	}
	vec4 depth = thickness * (extinction_per_m / mu_v);
	float least = min(min(depth.x, depth.y), min(depth.z, depth.w));
	vec4 seen = exp(vec4(least) - depth); // over that of the least
	float sum = dot(seen, vec4(1.0));
	float mean = least - log(sum / float(FIELD_ALONG_PARTS));
	vec4 met = vec4(1.0) - exp(-depth);
	return vec2(mean * mu_v / extinction_per_m, dot(thickness, met) / max(dot(met, vec4(1.0)), 1e-6));
}

float field_thickness(vec2 place, float footprint)
{
	return cloud_layer.w < 0.5 ? 0.0 : field_thickness_of(field_density(place, footprint), footprint);
}
#endif
