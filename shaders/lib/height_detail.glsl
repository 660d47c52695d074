// Puffs on the height field, finer than its texels.
#ifndef SHADERS_LIB_HEIGHT_DETAIL
#define SHADERS_LIB_HEIGHT_DETAIL
#include "shaders/lib/height.glsl"

// x: how far the surface bulges, y, z, w: how that rises along the axes, all as 0..1 (renderer/stages/height_puffs.c).
#ifndef __cplusplus
uniform sampler3D height_puffs;
#endif

// Texels across and down.
const float HEIGHT_SIZE_PUFFS = 128.0;
const float HEIGHT_DEPTH_PUFFS = 32.0;
// Steepest rise, full ranges a texel.
const float HEIGHT_PUFF_STEEPEST = 0.25;
// A puff bulges at most so far beyond its mean, as a share of the full range.
const float HEIGHT_PUFF_TOP = 0.5;
// Light sees nothing in droplets that is finer, m.
const float HEIGHT_PUFF_FINEST = 13.0;
// Where the field's texels are large, smaller ones stand on them, so much finer and lower.
const float HEIGHT_PUFF_STEP = 8.0;
const float HEIGHT_PUFF_LOWER = 0.25;

// How far puffs bulge from crease to top, m, on cloud of some thickness.
float height_puff_scale(float thickness)
{
	return cloud_puffs.x * thickness / (thickness + cloud_puffs.x + 1e-3);
}

vec4 height_puff_layer(vec3 at, float footprint, float tile)
{
	return textureLod(height_puffs, at, max(log2(footprint * HEIGHT_SIZE_PUFFS / tile), 0.0));
}

// At a place in the drifting field and a height over the base, seen at a footprint. x: how far a puff bulges beyond the mean, as a share of the full range; y, z, w:
// how that rises east, north and up, 1/m.
vec4 height_puff(vec2 place, float height, float footprint)
{
	float tile = cloud_puffs.y;
	vec3 at = vec3(place.x, place.y, height * (HEIGHT_SIZE_PUFFS / HEIGHT_DEPTH_PUFFS)) / tile + vec3(cloud_puffs_drift);
	vec4 puff = 2.0 * height_puff_layer(at, footprint, tile) - 1.0;
#if HEIGHT_NEAR == 2
	vec4 smaller = 2.0 * height_puff_layer(at * HEIGHT_PUFF_STEP, footprint, tile / HEIGHT_PUFF_STEP) - 1.0;
	puff += vec4(HEIGHT_PUFF_LOWER, vec3(HEIGHT_PUFF_LOWER * HEIGHT_PUFF_STEP)) * smaller;
#endif
	return puff * vec4(1.0, vec3(HEIGHT_PUFF_STEEPEST * HEIGHT_SIZE_PUFFS / tile));
}
#endif
