// Reflectance of the ground per band (650, 550, 450 nm), painted once as a periodic picture. GROUND_TYPE: enum ground_type, fixed when the program is
// built, since software renderers would execute all of them.
#ifndef SHADERS_LIB_GROUND_PAINT
#define SHADERS_LIB_GROUND_PAINT
#include "shaders/lib/noise.glsl"

// Published spectral albedos, read off at the bands. Vegetation, soils and sand: Bowker et al. 1985 ("Spectral Reflectances of Natural Targets for Use in Remote Sensing
// Studies", NASA RP-1139) and Feister and Grewe 1995 (Photochem. Photobiol. 62, 736: grass, stubble, bare fertile soil, dry beach sand).
const vec3 ALBEDO_GRASS = vec3(0.060, 0.110, 0.042);
const vec3 ALBEDO_GRASS_DRY = vec3(0.115, 0.130, 0.060);
const vec3 ALBEDO_MEADOW = vec3(0.075, 0.115, 0.045);
const vec3 ALBEDO_PASTURE = vec3(0.066, 0.105, 0.042);
const vec3 ALBEDO_GREEN_CROP = vec3(0.050, 0.088, 0.036);
const vec3 ALBEDO_FOREST = vec3(0.028, 0.045, 0.022);
const vec3 ALBEDO_CROP = vec3(0.20, 0.17, 0.085);
const vec3 ALBEDO_SOIL = vec3(0.15, 0.115, 0.075);
const vec3 ALBEDO_SOIL_DRY = vec3(0.22, 0.17, 0.11);
const vec3 ALBEDO_SAND = vec3(0.42, 0.36, 0.26);
const vec3 ALBEDO_SAND_MOIST = vec3(0.33, 0.27, 0.185);
// Asphalt and gravel, and tiles among them.
const vec3 ALBEDO_ROAD = vec3(0.19, 0.17, 0.14);
const vec3 ALBEDO_ROOF = vec3(0.20, 0.13, 0.10);
// Open water among ice, sky light reflected and light from below the surface together: Payne 1972 (J. Atmos. Sci. 29, 959), 0.06 under overcast.
const vec3 ALBEDO_WATER = vec3(0.055, 0.060, 0.068);
// White ice with a surface scattering layer, and snow on ice: Grenfell and Perovich 1984 (J. Geophys. Res. 89, 3573), Perovich 1996
// (CRREL Monograph 96-1).
const vec3 ALBEDO_ICE = vec3(0.68, 0.73, 0.75);
const vec3 ALBEDO_ICE_RIDGE = vec3(0.80, 0.83, 0.84);
// Clean snow is 0.97 to 0.99 (Wiscombe and Warren 1980, J. Atmos. Sci. 37, 2712; measured: Grenfell, Warren and Mullen 1994, J. Geophys. Res. 99, 18669); the soot of
// inhabited latitudes takes some percent of it (Warren and Wiscombe 1980).
const vec3 ALBEDO_SNOW = vec3(0.90, 0.92, 0.93);

// A patch of a patchwork: the nearest of jittered points.
struct ground_patch_at {
	uint hash;
	vec2 from_middle; // lattice cells
	float border;     // how much nearer it is than the second, lattice cells
};

ground_patch_at ground_patches(vec2 p, int period, uint seed)
{
	vec2 cell = floor(p);
	float second = 9.0;
	float nearest = 9.0;
	ground_patch_at at;
	at.hash = 0u;
	at.from_middle = vec2(0.0);
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
				at.hash = noise_hash(h + 3u);
				at.from_middle = -away;
			} else {
				second = min(second, d);
			}
		}
	}
	at.border = second - nearest;
	return at;
}

// A line cut into pieces 0.3 to 1.7 long. x: number of the piece, y: distance to the nearest cut.
vec2 ground_cut(float x, uint seed)
{
	float i = floor(x);
	float low = i + 0.7 * (noise_unit(noise_hash2(int(i), 0, seed)) - 0.5);
	float high = i + 1.0 + 0.7 * (noise_unit(noise_hash2(int(i) + 1, 0, seed)) - 0.5);
	if (x < low)
		return vec2(i - 1.0, low - x);
	return x > high ? vec2(i + 1.0, x - high) : vec2(i, min(x - low, high - x));
}

// How much of a texel a line takes up: its width and the distance from its middle, m.
float ground_line(float width, float distance, float texel)
{
	return clamp(0.5 * (width + texel) - distance, 0.0, min(width, texel)) / texel;
}

// What grows on a parcel.
vec3 ground_crop(uint hash)
{
	float u = noise_unit(hash);
	float tone = noise_unit(noise_hash(hash + 5u));
	vec3 crop = u < 0.28 ? ALBEDO_MEADOW : u < 0.52 ? ALBEDO_PASTURE : u < 0.70 ? ALBEDO_GREEN_CROP : u < 0.86 ? mix(ALBEDO_MEADOW, ALBEDO_CROP, 0.4 + 0.6 * tone)
	                                                                                                   : mix(ALBEDO_SOIL, ALBEDO_SOIL_DRY, 0.5 * tone);
	return crop * (0.88 + 0.24 * tone);
}

// Where along the way across a picture a river runs that crosses it from south to north: 0 on the river. Its bends are some kilometres wide.
float ground_river_side(vec2 p, float tile)
{
	float aside = p.x + 0.035 * noise_turbulence(p, max(1, int(tile / 7000.0 + 0.5)), 3, 59u, 0.0) - 0.62;
	return aside - floor(aside + 0.5);
}

// Metres to the river's middle, by its slope over the ground.
float ground_river_distance(vec2 p, float tile)
{
	float step_of_slope = 20.0 / tile;
	float here = ground_river_side(p, tile);
	vec2 slope = vec2(ground_river_side(p + vec2(step_of_slope, 0.0), tile), ground_river_side(p + vec2(0.0, step_of_slope), tile)) - here;
	return 20.0 * abs(here) / max(length(slope), 0.2 * step_of_slope);
}

// Districts between roads, each cut by its own grid into rows of parcels with straight borders, some with hedges; woods, which end where a parcel does or do not; some villages; and a river.
vec3 ground_country(vec2 p, float tile)
{
	p += vec2(0.0876, -0.0409); // the scene's origin lies on a meadow
	float texel = 0.5 * tile / ground_patch.x; // from sample to sample
	int districts = max(1, int(tile / 1900.0 + 0.5));
	float size = tile / float(districts);
	vec2 warp = 0.05 * vec2(noise_turbulence(p, districts, 2, 41u, 0.0), noise_turbulence(p, districts, 2, 42u, 0.0));
	ground_patch_at district = ground_patches(p * float(districts) + warp, districts, 43u);

	float angle = 2.0 * PI * noise_unit(district.hash);
	vec2 forth = vec2(cos(angle), sin(angle));
	vec2 place = vec2(dot(district.from_middle, forth), forth.x * district.from_middle.y - forth.y * district.from_middle.x) * size;
	float depth = 180.0 + 260.0 * noise_unit(noise_hash(district.hash + 1u));
	vec2 row = ground_cut(place.y / depth, district.hash);
	uint row_hash = noise_hash2(int(row.x), 1, district.hash);
	float width = depth * (0.35 + 0.9 * noise_unit(row_hash));
	vec2 column = ground_cut(place.x / width, row_hash);
	uint parcel = noise_hash2(int(row.x), int(column.x), district.hash);
	float border = min(row.y * depth, column.y * width);
	float road = 0.5 * district.border * size;

	vec3 field = ground_crop(parcel) * (1.0 + 0.05 * noise_turbulence(p, districts * 6, 4, 49u, 0.0));
	float hedges = 4.0 + 10.0 * noise_unit(noise_hash(district.hash + 2u));
	field = mix(field, ALBEDO_FOREST, ground_line(hedges, border, texel));

	int woods = max(1, int(tile / 2100.0 + 0.5));
	float tree = 0.75 * noise_turbulence(p, woods, 2, 44u, 0.0) + 0.10 * noise_turbulence(p, woods * 5, 2, 45u, 0.0) + 0.9 * (noise_unit(noise_hash(parcel + 7u)) - 0.5) - 0.62;
	vec3 forest = ALBEDO_FOREST * (1.0 + 0.12 * noise_turbulence(p, districts * 12, 3, 50u, 0.0));
	field = mix(field, forest, smoothstep(-0.02, 0.02, tree));

	vec2 lot = floor(place / 32.0);
	uint house = noise_hash2(int(lot.x), int(lot.y), district.hash + 9u);
	float reach = length(place) * (0.75 + 0.5 * noise_unit(house)) / (90.0 + 190.0 * noise_unit(noise_hash(district.hash + 4u)));
	bool village = (district.hash & 7u) == 0u && reach < 1.0;
	vec3 built = mix(ALBEDO_MEADOW, (house & 1u) == 0u ? ALBEDO_ROOF : ALBEDO_FOREST, 0.6);
	field = village ? built : field;
	field = mix(field, ALBEDO_ROAD, ground_line(7.0, road, texel));

	// A river between meadows, its banks grown over here and there.
	float river = ground_river_distance(p, tile);
	float bank = 150.0 + 90.0 * noise_turbulence(p, districts * 2, 2, 60u, 0.0);
	field = mix(field, mix(ALBEDO_MEADOW, forest, smoothstep(0.0, 0.4, tree + 0.55)), 1.0 - smoothstep(bank, bank + 40.0, river));
	return mix(field, ALBEDO_WATER, 1.0 - smoothstep(-0.5 * texel, 0.5 * texel, river - 38.0));
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
	ground_patch_at floe = ground_patches(p * float(floes) + warp, floes, 53u);
	ground_patch_at plate = ground_patches(p * float(plates) + warp * 2.5, plates, 55u);
	float basin = noise_turbulence(p, max(1, int(tile / 9000.0 + 0.5)), 4, 54u, 0.0);
	// Leads are wide where the basin opens, close to cracks elsewhere, and some are frozen over.
	float open = smoothstep(-0.4, 0.8, noise_turbulence(p, floes, 2, 56u, 0.0));
	float width = 0.024 * open - 0.012 * (1.0 - open) + 0.30 * smoothstep(0.2, 1.6, basin);
	float ice = smoothstep(width, width + 0.012, floe.border);
	// Plates frozen together: cracks between some, ridges of blocks between others, that are snow on the lee.
	float seam = 1.0 - smoothstep(0.02, 0.07, plate.border);
	float crack = seam * step(0.72, noise_unit(plate.hash));
	float ridge = (1.0 - smoothstep(0.03, 0.12, plate.border)) * step(noise_unit(plate.hash), 0.45);
	vec3 floor_of_floe = ALBEDO_ICE * (0.92 + 0.07 * noise_unit(floe.hash) + 0.05 * noise_unit(plate.hash) + 0.02 * noise_turbulence(p, plates * 4, 3, 57u, 0.0));
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
