// Against the repeat of the tile: far from the camera the field is looked up elsewhere, by waves of shear that never come together again. No two of the tile's copies then look alike
// nor lie on a lattice. Waves of shear keep areas, so that coverage and thicknesses stay what they are; within half a tile of the camera, where none of a repeat is seen and
// the light between ground and clouds shows its pattern, nothing moves.
#ifndef SHADERS_LIB_FIELD_WARP
#define SHADERS_LIB_FIELD_WARP
#include "shaders/lib/scene_block.glsl"

// Wave vectors, 1/tile, of wave lengths 2.3, 3.1 and 4.3 tiles at 60 degrees to each other; renderer/stages/view.c has them too, for the phases of the waves at the camera.
const vec2 FIELD_WARP_WAVE_0 = vec2(0.4158, 0.1271);
const vec2 FIELD_WARP_WAVE_1 = vec2(0.0726, 0.3143);
const vec2 FIELD_WARP_WAVE_2 = vec2(-0.1701, 0.1586);
// Across them, each as long that lines shear by 0.24 at most.
const vec2 FIELD_WARP_SHIFT_0 = vec2(-0.1614, 0.5279);
const vec2 FIELD_WARP_SHIFT_1 = vec2(-0.7250, 0.1674);
const vec2 FIELD_WARP_SHIFT_2 = vec2(-0.7038, -0.7548);
// Squares of the distances, in tiles, where it begins and is whole.
const float FIELD_WARP_BEGIN = 0.25;
const float FIELD_WARP_WHOLE = 5.0;
// Lengths in the tile are at most those outside over this, but in a few places.
const float FIELD_WARP_SHRINK = 0.7;

// Shift, in tiles, at an offset from the camera, in tiles.
vec2 field_warp(vec2 offset)
{
	vec3 turn = vec3(dot(offset, FIELD_WARP_WAVE_0), dot(offset, FIELD_WARP_WAVE_1), dot(offset, FIELD_WARP_WAVE_2)) + vec3(cloud_warp);
	turn -= floor(turn + 0.5);
	vec3 wave = turn * (vec3(1.0) - 2.0 * abs(turn)); // a sine by parabolas, of slope 1
	float unit = clamp((dot(offset, offset) - FIELD_WARP_BEGIN) * (1.0 / (FIELD_WARP_WHOLE - FIELD_WARP_BEGIN)), 0.0, 1.0);
	float share = cloud_warp.w * unit * unit * (3.0 - 2.0 * unit);
	return share * (wave.x * FIELD_WARP_SHIFT_0 + wave.y * FIELD_WARP_SHIFT_1 + wave.z * FIELD_WARP_SHIFT_2);
}

// Of lengths that may be passed at an offset, where lookups hold for a length in the tile.
float field_warp_reach(vec2 offset)
{
	return dot(offset, offset) > FIELD_WARP_BEGIN ? FIELD_WARP_SHRINK : 1.0;
}

// Place in the drifting field, m, of one in the world. FIELD_WARPED: of what the camera sees; otherwise of the tile itself. FIELD_NEAR: all lies near the camera.
vec2 field_place(vec2 place)
{
	vec2 drifting = place - vec2(cloud_drift.x, cloud_drift.y);
#if defined(FIELD_WARPED) && !defined(FIELD_NEAR)
	drifting += cloud_layer.z * field_warp((place - vec2(camera_position)) / cloud_layer.z);
#endif
	return drifting;
}
#endif
