// Reflectance of the ground per band (650, 550, 450 nm), painted once as a periodic picture over the tile. GROUND_TYPE: enum ground_type, fixed when the program is
// built, since software renderers would execute all of them.
#ifndef SHADERS_LIB_GROUND_PAINT
#define SHADERS_LIB_GROUND_PAINT
#include "shaders/lib/noise.glsl"

// Published spectral albedos, read off at the bands. Vegetation, soils and sand: Bowker et al. 1985 ("Spectral Reflectances of Natural Targets for Use in Remote Sensing
// Studies", NASA RP-1139) and Feister and Grewe 1995 (Photochem. Photobiol. 62, 736: grass, stubble, bare fertile soil, dry beach sand).
const vec3 ALBEDO_GRASS = vec3(0.060, 0.110, 0.042);
const vec3 ALBEDO_GRASS_DRY = vec3(0.115, 0.130, 0.060);
const vec3 ALBEDO_MEADOW = vec3(0.075, 0.115, 0.045);
const vec3 ALBEDO_FOREST = vec3(0.028, 0.045, 0.022);
const vec3 ALBEDO_CROP = vec3(0.20, 0.17, 0.085);
const vec3 ALBEDO_SOIL = vec3(0.15, 0.115, 0.075);
const vec3 ALBEDO_SOIL_DRY = vec3(0.22, 0.17, 0.11);
const vec3 ALBEDO_SAND = vec3(0.42, 0.36, 0.26);
const vec3 ALBEDO_SAND_MOIST = vec3(0.33, 0.27, 0.185);
// Open water among ice, sky light reflected and light from below the surface together: Payne 1972 (J. Atmos. Sci. 29, 959), 0.06 under overcast.
const vec3 ALBEDO_WATER = vec3(0.055, 0.060, 0.068);
// White ice with a surface scattering layer, and snow on ice: Grenfell and Perovich 1984 (J. Geophys. Res. 89, 3573), Perovich 1996
// (CRREL Monograph 96-1).
const vec3 ALBEDO_ICE = vec3(0.68, 0.73, 0.75);
const vec3 ALBEDO_ICE_RIDGE = vec3(0.80, 0.83, 0.84);
// Clean snow is 0.97 to 0.99 (Wiscombe and Warren 1980, J. Atmos. Sci. 37, 2712; measured: Grenfell, Warren and Mullen 1994, J. Geophys. Res. 99, 18669); the soot of
// inhabited latitudes takes some percent of it (Warren and Wiscombe 1980).
const vec3 ALBEDO_SNOW = vec3(0.90, 0.92, 0.93);

// Patchwork: the two nearest of jittered points, by a distance that makes right angles if `angular`. x: hash 0..1 of the nearest, y: distance to the border between both, in lattice cells.
vec2 ground_patches(vec2 p, int period, uint seed, bool angular)
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
			float d = angular ? max(abs(away.x + 0.3 * away.y), abs(away.y - 0.3 * away.x)) : length(away);
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
	vec2 warp = 0.06 * vec2(noise_turbulence(p, fields, 3, 41u, 0.0), noise_turbulence(p, fields, 3, 42u, 0.0));
	vec2 patches = ground_patches(p * float(fields) + warp, fields, 43u, true);
	vec3 field = patches.x < 0.5 ? mix(ALBEDO_MEADOW, vec3(0.095, 0.13, 0.05), 2.0 * patches.x)
	                             : patches.x < 0.8 ? mix(ALBEDO_MEADOW, ALBEDO_CROP, (patches.x - 0.5) / 0.3) : ALBEDO_SOIL;
	field *= 1.0 + 0.06 * noise_turbulence(p, fields * 2, 4, 49u, 0.0);
	float wood = smoothstep(0.35, 0.5, noise_turbulence(p, woods, 6, 44u, 0.0));
	float hedge = 1.0 - smoothstep(0.02, 0.05, patches.y);
	return mix(mix(field, ALBEDO_FOREST, 0.6 * hedge), ALBEDO_FOREST, wood);
}

// Drier and moister, over the tile.
vec3 ground_mottled(vec2 p, float tile, vec3 first, vec3 second, uint seed)
{
	int patches = max(1, int(tile / 1700.0 + 0.5));
	return mix(first, second, smoothstep(-1.3, 1.7, noise_turbulence(p, patches, 6, seed, 0.0)));
}

vec3 ground_sea_ice(vec2 p, float tile)
{
	int floes = max(1, int(tile / 3400.0 + 0.5));
	int plates = floes * 5;
	vec2 warp = 0.06 * vec2(noise_turbulence(p, floes, 6, 51u, 0.0), noise_turbulence(p, floes, 6, 52u, 0.0));
	vec2 floe = ground_patches(p * float(floes) + warp, floes, 53u, false);
	vec2 plate = ground_patches(p * float(plates) + warp * 2.5, plates, 55u, false);
	float basin = noise_turbulence(p, max(1, int(tile / 9000.0 + 0.5)), 4, 54u, 0.0);
	// Leads are wide where the basin opens and close to cracks elsewhere.
	float width = 0.015 + 0.30 * smoothstep(0.2, 1.6, basin);
	float ice = smoothstep(width, width + 0.012, floe.y);
	// Plates frozen together: cracks between some, ridges of blocks between others, that are snow on the lee.
	float seam = 1.0 - smoothstep(0.02, 0.07, plate.y);
	float crack = seam * step(0.72, plate.x);
	float ridge = (1.0 - smoothstep(0.03, 0.12, plate.y)) * step(plate.x, 0.45);
	vec3 floor_of_floe = ALBEDO_ICE * (0.92 + 0.07 * floe.x + 0.05 * plate.x + 0.02 * noise_turbulence(p, plates * 4, 3, 57u, 0.0));
	vec3 white = mix(mix(floor_of_floe, ALBEDO_ICE_RIDGE, 0.7 * ridge), ALBEDO_WATER, 0.8 * crack);
	return mix(ALBEDO_WATER, white, ice);
}

vec3 ground_snow(vec2 p, float tile)
{
	int drifts = max(1, int(tile / 900.0 + 0.5));
	return ALBEDO_SNOW * (1.0 + 0.012 * noise_turbulence(p, drifts, 5, 58u, 0.0));
}

// p: place in tiles.
vec3 ground_paint(vec2 p)
{
	float tile = ground_mean_albedo.w;
#if GROUND_TYPE == 0
	vec3 albedo = ground_mottled(p, tile, ALBEDO_GRASS, ALBEDO_GRASS_DRY, 46u);
#elif GROUND_TYPE == 1
	vec3 albedo = ground_country(p, tile);
#elif GROUND_TYPE == 2
	vec3 albedo = ground_mottled(p, tile, ALBEDO_SOIL, ALBEDO_SOIL_DRY, 47u);
#elif GROUND_TYPE == 3
	vec3 albedo = ground_mottled(p, tile, ALBEDO_SAND, ALBEDO_SAND_MOIST, 48u);
#elif GROUND_TYPE == 5
	vec3 albedo = ground_sea_ice(p, tile);
#elif GROUND_TYPE == 6
	vec3 albedo = ground_snow(p, tile);
#else
	vec3 albedo = vec3(GROUND_TYPE == 7 ? 0.0 : 1.0); // sea and lambert: the scale is all there is
#endif
	return min(albedo * vec3(ground_albedo), vec3(1.0));
}
#endif
