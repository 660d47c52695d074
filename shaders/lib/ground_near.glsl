// What of the ground is smaller than a texel of its painted picture, for what lies close by.
//
// The small is made at the size of a pixel, whatever that is: noise on the two or three lattices that are just coarse enough to be seen, faded in and out as the
// footprint changes, so that nothing repeats and nothing is smeared. It changes no mean. VIEW_GROUND: 0 bare, 1 grown over, 2 sea (shaders/lib/sea.glsl), 3 sea ice.
#ifndef SHADERS_LIB_GROUND_NEAR
#define SHADERS_LIB_GROUND_NEAR
#include "shaders/lib/ground_lattice.glsl"
#include "shaders/lib/slopes.glsl"

// Decided when the shader is built: are pixels anywhere so small that tufts, or the finest of ragged edges, are seen (renderer/stages/view.c)?
#ifndef VIEW_GROUND_CLOSE
#define VIEW_GROUND_CLOSE 1
#endif

// What a pixel sees of the ground.
struct ground_point {
	vec2 offset;  // from the camera's foot, m
	float across; // size of the pixel there across the view, m
	float mu_v;   // cosine of the view to the vertical there
	float mu_sun;
};

#if VIEW_GROUND == 0 || VIEW_GROUND == 3
// Ripples and drifts lie across no axis.
vec2 ground_turned(vec2 v)
{
	return vec2(0.8 * v.x - 0.6 * v.y, 0.6 * v.x + 0.8 * v.y);
}

// Bare ground: relief on lattices four times as coarse as each other. ground_patch: y contrast of its reflectance, z deviation of the slopes of one lattice along each
// axis, w how much longer its small forms are than wide. x: factor of the beam, y: factor of all light.
vec3 ground_detail(ground_point p)
{
	// Forms are seen foreshortened: what a pixel covers along the view is gone.
	float footprint = 1.4 * p.across * min(inversesqrt(p.mu_v), 2.5);
	float scale = 0.5 * log2(max(footprint, 1e-3));
	float finest = floor(scale);
	float passed = scale - finest;
	float tangent = min(sqrt(max(1.0 - p.mu_sun * p.mu_sun, 0.0)) / max(p.mu_sun, 0.05), 12.0);
	vec2 flat_sun = vec2(sun_direction.x, sun_direction.y);
	vec2 heading = ground_turned(flat_sun * inversesqrt(max(dot(flat_sun, flat_sun), 1e-9)));
	vec2 foot = ground_turned(vec2(camera_position.x, camera_position.y));
	vec2 offset = ground_turned(p.offset);
	float slope = 0.0; // towards the sun
	float shade = 0.0;
	float variance = 0.0;
	for (int i = 0; i < 3; i++) {
		float size = exp2(2.0 * (finest + float(i) + 0.5));
		float weight = i == 0 ? 1.0 - passed : i == 2 ? passed : 1.0;
		// Large forms are flat and longer than wide no more.
		float flatness = 1.0 / (1.0 + size * size * 0.003);
		vec2 stretch = vec2(1.0 + (ground_patch.w - 1.0) * flatness, 1.0);
		vec3 n = ground_noise(ground_lattice_at(foot, offset, size * stretch), 71u + uint(int(finest) + 20 + i));
		vec2 steepness = weight * flatness * heading / stretch;
		slope += dot(vec2(n.x, n.y), steepness);
		shade += weight * n.z;
		variance += dot(steepness, steepness);
	}
	// Sunlight on the slopes over that on the flat, and the mean of it, which a low sun takes away from 1.
	float tilt = max(ground_patch.z * sqrt(variance) * tangent, 1e-3);
	float beam = max(1.0 - ground_patch.z * tangent * slope, 0.0) / (tilt * normal_ramp(1.0 / tilt));
	return vec3(beam, max(1.0 + ground_patch.y * shade, 0.3), 0.0);
}
#endif
#if VIEW_GROUND == 1
// What grows is patches that differ in tone and colour, seen foreshortened, and on them what stands up: at a slant, tufts one behind the other. Rows of these stand across the view
// (nearly: in one of eight directions, on lattices of the world), as far apart as shows a part of each over the one before it.
const float GROUND_TUFT = 0.22; // m across, the smallest; farther away several are one
const float GROUND_TUFTS_END = 0.6; // m a pixel, in which none is seen any more
const float GROUND_BLADES = 10.0; // in a tuft; likewise, lest they be smaller than pixels

// What a patch, or a blade, is brighter by where it is drier (shaders/lib/ground_paint.glsl, dry grass over green).
const vec3 GROUND_DRIER = vec3(0.9, 0.2, 0.45);

// Reflectance where it is so much drier than the mean. What is not green, as soil, hardly changes its colour.
vec3 ground_drier(vec3 reflectance, float drier)
{
	float green = clamp(reflectance.y / max(reflectance.x, 1e-4) - 0.5, 0.0, 1.0);
	return reflectance * (vec3(1.0) + GROUND_DRIER * (green * drier));
}

// One row's tufts at a place along it, in tufts. x: height 0..1, y: tone -1..1.
vec2 ground_tuft(float base, float inside, int row, uint seed)
{
	float p = floor(inside);
	float f = inside - p;
	int column = int(p) + int(base);
	uint h = noise_hash2(column, row, seed);
	uint k = noise_hash2(column + 1, row, seed);
	f = f * f * (3.0 - 2.0 * f);
	return mix(vec2(float(h & 0xffffu), float(h >> 16u)), vec2(float(k & 0xffffu), float(k >> 16u)), f) * vec2(1.0 / 65535.0, 2.0 / 65535.0) - vec2(0.0, 1.0);
}

// Rows of tufts: the columns of their lattice at the camera's foot, a whole number and the rest, and as much of blades'; blades in a tuft.
struct ground_rows {
	vec2 columns;
	vec2 blades;
	float finer;
};

// What a ray sees that meets a row: x height of the row there, 1..2; y tone. along: where, from the foot, in tufts; rise: height of the ray.
vec2 ground_row(ground_rows rows, int row, float along, float rise)
{
	vec2 tuft = ground_tuft(rows.columns.x, rows.columns.y + along, row, 62u);
	// Blades of a tuft lean one way or the other.
	vec2 blade = ground_tuft(rows.blades.x, rows.blades.y + (along + 0.3 * tuft.y * rise) * rows.finer, row, 63u);
	float height = 1.0 + 0.6 * tuft.x + 0.4 * blade.x;
	return vec2(height, 0.45 * tuft.y + 0.75 * blade.y + 1.5 * (rise / height - 0.635));
}

// Tone of what stands up, of deviation about 1 where tufts are of their own size. fray: noise that borders between tufts of one size or direction and the next are frayed by.
float ground_tufts(ground_point p, vec3 fray)
{
	float heading = floor(atan(p.offset.x, p.offset.y) * (8.0 / PI) + 0.5 + 0.15 * fray.y) * (PI / 8.0);
	vec2 forth = vec2(sin(heading), cos(heading));
	vec2 aside = vec2(forth.y, -forth.x);
	vec2 place = vec2(camera_position.x, camera_position.y);
	vec2 offset = vec2(dot(p.offset, aside), dot(p.offset, forth)); // along a row, across rows
	vec2 foot = vec2(dot(place, aside), dot(place, forth));
	float coarseness = log2(max(p.across / GROUND_TUFT, 1e-4)) + 0.35 * fray.z;
	float level = max(floor(coarseness + 2.6), 0.0);
	float width = GROUND_TUFT * exp2(level);
	float spacing = width * exp2(ceil(log2(max(0.5 / p.mu_v, 1.0)) + 0.3 * fray.x));
	float before = floor(foot.y / spacing);
	float at = foot.y / spacing - before + offset.y / spacing + 0.5 * fray.y; // rows are bent, too
	float nearest = floor(at);
	float rise = at - nearest;
	int row = int(nearest) + int(before);
	ground_rows rows;
	rows.finer = GROUND_BLADES * exp2(level - max(floor(coarseness + 4.3), 0.0));
	rows.columns.x = floor(foot.x / width);
	rows.columns.y = foot.x / width - rows.columns.x;
	rows.blades.x = floor(foot.x * (rows.finer / width));
	rows.blades.y = foot.x * (rows.finer / width) - rows.blades.x;
	// Where a row stands the ray is as far aside as it goes aside on its way there, so that stems stand upright.
	float aside_of_row = offset.x / (width * max(offset.y, 1e-3)) * spacing;
	float stands = nearest - (foot.y / spacing - before);
	vec2 front = ground_row(rows, row - 1, aside_of_row * (stands - 1.0), rise + 1.0);
	vec2 back = ground_row(rows, row, aside_of_row * stands, rise);
	return mix(back.y, front.y, clamp((front.x - 1.0 - rise) * spacing * p.mu_v / p.across + 0.5, 0.0, 1.0)) * sqrt(GROUND_TUFT / width);
}

// As for bare ground; z: how much drier than the mean.
vec3 ground_detail(ground_point p)
{
	vec2 place = vec2(camera_position.x, camera_position.y);
	// Patches on lattices four times as coarse as each other, from the finest on that shows between rows of pixels.
	float scale = 0.5 * log2(max(p.across / p.mu_v, 0.01));
	float finest = floor(scale);
	float passed = scale - finest;
	float tone = 0.0;
	float dry = 0.0;
	for (int i = 0; i < 3; i++) {
		float size = exp2(2.0 * (finest + float(i) + 0.5));
		float weight = (i == 0 ? 1.0 - passed : i == 2 ? passed : 1.0) * (0.12 / (1.0 + size * size * 4e-6) + 0.88 / (1.0 + size * size * 1e-3));
		vec3 n = ground_noise(ground_lattice_at(place, p.offset, vec2(size)), 65u + uint(int(finest) + 20 + i));
		tone += weight * n.z;
		dry += weight * n.x;
	}
	// Of some metres, which also bend the rows of tufts, and fray the borders between those of one size or direction and the next.
	vec3 patches = ground_noise(ground_lattice_at(place, p.offset, vec2(4.7)), 61u);
	float shown = 0.7 / (1.0 + p.across / p.mu_v);
	tone += shown * patches.z;
	dry += shown * patches.x;
	float tufts = 0.0;
#if VIEW_GROUND_CLOSE
	tufts = ground_tufts(p, patches) * (1.0 - smoothstep(0.1, 0.45, p.mu_v)) * (1.0 - smoothstep(0.3 * GROUND_TUFTS_END, GROUND_TUFTS_END, p.across));
#endif
	return vec3(1.0, max(1.0 + ground_patch.y * (0.36 * tone + 0.9 * tufts), 0.15), 0.15 * dry + 0.1 * tufts);
}
#endif
#if VIEW_GROUND == 3
const float GROUND_ICE_MIDDLE = 0.42; // at 550 nm, times the scale

// Edges of floes are sharp and ragged, where the painted picture's texels are tens of metres: moved by less than a texel, and steeper around the middle between water and ice.
vec2 ground_ragged(ground_point p)
{
	float texel = ground_mean_albedo.w / ground_patch.x;
	vec2 foot = vec2(camera_position.x, camera_position.y);
	vec3 wide = ground_noise(ground_lattice_at(foot, p.offset, vec2(0.9 * texel)), 64u);
	// What is shorter than the pixel's strip would come out as dots.
	float strip = p.across / (p.mu_v * texel);
	vec2 moved = 0.22 / (1.0 + 2.0 * strip * strip) * vec2(wide.x, wide.z);
#if VIEW_GROUND_CLOSE
	vec3 narrow = ground_noise(ground_lattice_at(foot, p.offset, vec2(0.23 * texel)), 65u);
	moved += 0.10 / (1.0 + 40.0 * strip * strip) * vec2(narrow.z, narrow.y);
#endif
	return texel * moved;
}

vec3 ground_ice(vec3 reflectance, float footprint)
{
	float texel = ground_mean_albedo.w / ground_patch.x;
	float steepness = 1.0 + 5.0 / (1.0 + footprint * footprint * (50.0 / texel / texel));
	float middle = max(GROUND_ICE_MIDDLE * ground_albedo.y, 1e-3);
	float ice = reflectance.y / middle - 1.0;
	float sharp = clamp(0.5 + 0.5 * ice * steepness, 0.5 + 0.5 * min(ice, -0.85), 0.5 + 0.5 * max(ice, 0.75));
	return reflectance * (middle * 2.0 * sharp / max(reflectance.y, 1e-4));
}
#endif
#endif
