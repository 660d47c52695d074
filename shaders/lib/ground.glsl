// Reflectance of the ground out of its painted picture (shaders/lib/ground_paint.glsl).
#ifndef SHADERS_LIB_GROUND
#define SHADERS_LIB_GROUND
#include "shaders/lib/ground_lattice.glsl"

// Decided when the shader is built: may ground beyond home be seen?
#ifndef VIEW_GROUND_REGIONS
#define VIEW_GROUND_REGIONS 1
#endif

#ifndef __cplusplus
uniform sampler2D ground_map;
#endif

// Regions, in pictures: the one at home is a square with this middle and half this size, others are of size 1; borders are moved by waves.
const float GROUND_HOME = 0.25;
const float GROUND_HOME_REACH = 0.65;
const float GROUND_HOME_SURE = 0.55; // within which no border comes

// The picture repeats, which shows from far above. So what is seen is made of regions with ragged borders, each of which shows the picture from another place of it on, turned by
// quarters, mirrored or not, and a little bent; the region at home shows it as the radiosity has it. place: in pictures, from the world's origin; x, y: the place in the picture that shows there; z: tone of deviation
// about 1 that varies over regions, 0 at home.
vec3 ground_region_at(vec2 place)
{
	vec2 across = vec2(place.y, place.x);
	vec2 wide = sin(vec2(9.1, 7.7) * across + 2.0 * sin(vec2(3.7, 4.3) * place));
	vec2 moved = place + 0.06 * wide + 0.018 * sin(83.0 * across + 4.0 * wide);
	vec2 from_home = abs(moved - GROUND_HOME);
	float away = max(from_home.x, from_home.y);
	vec2 cell = floor(moved + 0.5);
	uint h = noise_hash2(int(cell.x), int(cell.y), 83u);
	bool home = away < GROUND_HOME_REACH;
	vec2 start = home ? vec2(0.0) : vec2(float(h & 0xffffu), float(h >> 16u)) * (1.0 / 65536.0);
	uint turn = home ? 0u : h;
	vec2 outside = abs(place - GROUND_HOME);
	float far = smoothstep(GROUND_HOME_SURE, 1.0, max(outside.x, outside.y));
	vec2 bent = place + far * 0.03 * wide;
	vec2 turned = (turn & 1u) == 0u ? bent : vec2(-bent.y, bent.x);
	turned *= vec2((turn & 2u) == 0u ? 1.0 : -1.0, (turn & 4u) == 0u ? 1.0 : -1.0);
	return vec3(turned + start, far * (wide.x + wide.y));
}

// place: metres east and north; footprint: size of what is averaged, m. Per band.
vec3 ground_reflectance(vec2 place, float footprint)
{
	float side = ground_mean_albedo.w;
	return vec3(textureLod(ground_map, place / side, max(0.0, log2(footprint * ground_patch.x / side))));
}

// As it is seen.
vec3 ground_reflectance_seen(vec2 place, float footprint)
{
	vec3 at = vec3(place / ground_mean_albedo.w, 0.0);
#if VIEW_GROUND_REGIONS
	if (ground_region.z > 0.5)
		at = ground_region_at(vec2(at) + vec2(ground_region));
#endif
	vec3 reflectance = vec3(textureLod(ground_map, vec2(at), max(0.0, log2(footprint * ground_patch.x / ground_mean_albedo.w))));
	return reflectance * (1.0 + 0.3 * ground_patch.y * at.z);
}
#endif
