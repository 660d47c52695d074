// Reflectance of the ground per band (650, 550, 450 nm), painted once as a periodic picture over the tile. Broad-band means follow published surface albedos: fresh
// snow 0.8 to 0.9 and bare sea ice 0.5 to 0.7 (Grenfell and Perovich 1984), open water 0.06 at moderate sun heights (Payne 1972), meadow
// and crops 0.05 to 0.15 in the visible (Bowker et al. 1985).
#ifndef SHADERS_LIB_GROUND_PAINT
#define SHADERS_LIB_GROUND_PAINT
#include "shaders/lib/noise.glsl"

const float GROUND_SEA = 4.0;
const float GROUND_SEA_ICE = 5.0;
const float GROUND_SNOW = 6.0;
const float GROUND_BLACK = 7.0;
const float GROUND_LAMBERT = 8.0;

const vec3 ALBEDO_MEADOW = vec3(0.075, 0.115, 0.045);
const vec3 ALBEDO_FOREST = vec3(0.028, 0.045, 0.022);
const vec3 ALBEDO_CROP = vec3(0.20, 0.17, 0.085);
const vec3 ALBEDO_SOIL = vec3(0.15, 0.115, 0.075);
const vec3 ALBEDO_WATER = vec3(0.045, 0.055, 0.07);
const vec3 ALBEDO_ICE = vec3(0.68, 0.73, 0.75);
const vec3 ALBEDO_SNOW = vec3(0.84, 0.86, 0.87);

// Patchwork of fields: the two nearest of jittered points. x: hash 0..1 of the nearest, y: distance to the border between both, in lattice cells.
vec2 ground_patches(vec2 p, int period, uint seed)
{
	vec2 cell = floor(p);
	float nearest = 9.0;
	float second = 9.0;
	float id = 0.0;
	for (int dy = -1; dy <= 1; dy++) {
		for (int dx = -1; dx <= 1; dx++) {
			int x = int(cell.x) + dx;
			int y = int(cell.y) + dy;
			uint h = noise_hash2(noise_wrap(x, period), noise_wrap(y, period), seed);
			vec2 away = vec2(float(x), float(y)) + vec2(noise_unit(h), noise_unit(noise_hash(h))) - p;
			float d = length(away);
			if (d < nearest) {
				second = nearest;
				nearest = d;
				id = noise_unit(noise_hash(h + 3u));
			} else {
				second = min(second, d);
			}
		}
	}
	return vec2(id, second - nearest);
}

vec3 ground_country(vec2 p, float tile)
{
	int fields = max(1, int(tile / 420.0 + 0.5));
	int woods = max(1, int(tile / 2600.0 + 0.5));
	vec2 warp = 0.25 * vec2(noise_gradient(p * float(fields), fields, 41u, 0.0), noise_gradient(p * float(fields), fields, 42u, 0.0));
	vec2 patches = ground_patches(p * float(fields) + warp, fields, 43u);
	vec3 field = patches.x < 0.5 ? mix(ALBEDO_MEADOW, vec3(0.095, 0.13, 0.05), 2.0 * patches.x)
	                             : patches.x < 0.8 ? mix(ALBEDO_MEADOW, ALBEDO_CROP, (patches.x - 0.5) / 0.3) : ALBEDO_SOIL;
	float wood = smoothstep(0.35, 0.5, noise_turbulence(p, woods, 6, 44u, 0.0));
	float hedge = 1.0 - smoothstep(0.02, 0.05, patches.y);
	return mix(mix(field, ALBEDO_FOREST, 0.6 * hedge), ALBEDO_FOREST, wood);
}

vec3 ground_sea_ice(vec2 p, float tile)
{
	int floes = max(1, int(tile / 3400.0 + 0.5));
	vec2 warp = 0.13 * vec2(noise_turbulence(p, floes, 3, 51u, 0.0), noise_turbulence(p, floes, 3, 52u, 0.0));
	vec2 floe = ground_patches(p * float(floes) + warp, floes, 53u);
	float basin = noise_turbulence(p, max(1, int(tile / 9000.0 + 0.5)), 4, 54u, 0.0);
	// Leads are wide where the basin opens and close to cracks elsewhere.
	float width = 0.015 + 0.30 * smoothstep(0.2, 1.6, basin);
	float ice = smoothstep(width, width + 0.012, floe.y);
	return mix(ALBEDO_WATER, ALBEDO_ICE * (0.93 + 0.12 * floe.x), ice);
}

// p: place in tiles.
vec3 ground_paint(vec2 p)
{
	float tile = ground_mean_albedo.w;
	float type = ground_albedo.w;
	vec3 albedo = vec3(1.0);
	if (type < GROUND_SEA - 0.5)
		albedo = ground_country(p, tile);
	else if (type < GROUND_SEA_ICE - 0.5)
		albedo = ALBEDO_WATER;
	else if (type < GROUND_SNOW - 0.5)
		albedo = ground_sea_ice(p, tile);
	else if (type < GROUND_BLACK - 0.5)
		albedo = ALBEDO_SNOW;
	else if (type < GROUND_LAMBERT - 0.5)
		albedo = vec3(0.0);
	return min(albedo * vec3(ground_albedo), vec3(1.0));
}
#endif
