// Puffs on the height field, finer than its texels.
#ifndef SHADERS_LIB_HEIGHT_DETAIL
#define SHADERS_LIB_HEIGHT_DETAIL
#include "shaders/lib/height.glsl"

// x: how far the surface bulges, y, z, w: how that rises along the axes, all as 0..1 (renderer/stages/height_puffs.c).
#ifndef __cplusplus
uniform sampler3D height_puffs;
uniform sampler2D height_puff_layers;
#endif

// Texels across and down.
const float HEIGHT_SIZE_PUFFS = 128.0;
const float HEIGHT_DEPTH_PUFFS = 30.0;
// Of the planes alone, four in a texel.
const float HEIGHT_PUFF_GROUPS = 10.0;
const float HEIGHT_PUFF_GROUP_ROWS = 130.0;
// Steepest rise, full ranges a texel.
const float HEIGHT_PUFF_STEEPEST = 0.25;
// A puff bulges at most so far beyond its mean, as a share of the full range.
#if HEIGHT_NEAR == 2
const float HEIGHT_PUFF_TOP = 0.6;
#else
const float HEIGHT_PUFF_TOP = 0.5;
#endif
// Light sees nothing in droplets that is finer, m.
const float HEIGHT_PUFF_FINEST = 16.0;
// Where the field's texels are large, smaller ones stand on them, so much finer and lower.
const float HEIGHT_PUFF_STEP = 8.0;
const float HEIGHT_PUFF_LOWER = 0.18;

// How far puffs bulge from crease to top, m, on cloud of some thickness.
float height_puff_scale(float thickness)
{
	return cloud_puffs.x * thickness / (thickness + 0.6 * cloud_puffs.x + 1e-3);
}

// Where in the volume a place in the drifting field and a height over the base are.
vec3 height_puff_place(vec2 place, float height)
{
	return vec3(place.x, place.y, height * (HEIGHT_SIZE_PUFFS / HEIGHT_DEPTH_PUFFS)) / cloud_puffs.y + vec3(cloud_puffs_drift);
}

float height_bulge_layer(vec3 at)
{
	float plane = fract(at.z - 0.5 / HEIGHT_DEPTH_PUFFS) * HEIGHT_PUFF_GROUPS;
	float group = floor(plane);
	float row = group * HEIGHT_PUFF_GROUP_ROWS + 1.0 + fract(at.y) * HEIGHT_SIZE_PUFFS;
	vec4 planes = textureLod(height_puff_layers, vec2(at.x, row / (HEIGHT_PUFF_GROUPS * HEIGHT_PUFF_GROUP_ROWS)), 0.0);
	vec4 share = max(vec4(1.0) - abs(vec4(3.0 * (plane - group)) - vec4(0.0, 1.0, 2.0, 3.0)), vec4(0.0));
	return 2.0 * dot(planes, share) - 1.0;
}

// How far a puff bulges beyond the mean, as a share of the full range; fades out as pixels become larger than the finest of it.
float height_bulge(vec2 place, float height, float footprint)
{
	vec3 at = height_puff_place(place, height);
	float bulge = height_bulge_layer(at);
#if HEIGHT_NEAR == 2
	bulge += HEIGHT_PUFF_LOWER * height_bulge_layer(at * HEIGHT_PUFF_STEP);
#endif
	float texels = footprint * (0.5 * HEIGHT_SIZE_PUFFS) / cloud_puffs.y;
	return bulge / (1.0 + texels * texels);
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
	vec3 at = height_puff_place(place, height);
	vec4 puff = 2.0 * height_puff_layer(at, footprint, tile) - 1.0;
#if HEIGHT_NEAR == 2
	vec4 smaller = 2.0 * height_puff_layer(at * HEIGHT_PUFF_STEP, footprint, tile / HEIGHT_PUFF_STEP) - 1.0;
	puff += vec4(HEIGHT_PUFF_LOWER, vec3(HEIGHT_PUFF_LOWER * HEIGHT_PUFF_STEP)) * smaller;
#endif
	return puff * vec4(1.0, vec3(HEIGHT_PUFF_STEEPEST * HEIGHT_SIZE_PUFFS / tile));
}
#endif
