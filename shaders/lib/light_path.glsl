// Light paths of the reference model, followed backwards from the camera: the layer as the volume between its base and the tops, filled with droplets.
//
// Free paths are drawn for the largest extinction of the bands and collisions outside the cloud do not count (Woodcock et al. 1965, "delta tracking"), so that
// nothing depends on how finely a surface is looked for. A path is drawn for one band, its hero, and seen in all three, each weighed by the mean of the densities with
// which the bands would have drawn it (Wilkie et al. 2014, "Hero Wavelength Spectral Sampling": the balance heuristic over bands).
#ifndef SHADERS_LIB_LIGHT_PATH
#define SHADERS_LIB_LIGHT_PATH
#include "shaders/lib/field_warp.glsl"
#include "shaders/lib/noise.glsl"
#include "shaders/lib/optics.glsl"
#include "shaders/lib/sky_table.glsl"
#include "shaders/lib/sphere.glsl"
#include "shaders/lib/sunlight.glsl"

#ifndef __cplusplus
uniform sampler2D path_tops;     // heights of the tops above the base over the tile, m
uniform sampler2D path_bounds;   // the largest of them within a texel and its neighbours
uniform sampler2D phase_inverse; // per band the phase unit (shaders/lib/optics.glsl) below which a share of all scattering lies
uniform sampler2D forward_chains;
uniform sampler2D sky_at_layer; // clear sky from the top of the layer, and from the ground
uniform sampler2D sky_at_ground;
#endif

const float PATH_BOUNDS_SIZE = 64.0;
const float PATH_INVERSE_SIZE = 4096.0;
// Bands are heroes as often as they count for what is seen.
const vec3 PATH_HERO_SHARE = vec3(0.3, 0.45, 0.25);

// What a path does next.
const int PATH_START = 0;  // leaves the camera
const int PATH_LAYER = 1;  // flies through the layer
const int PATH_SUN = 2;    // looks for the sun from there (shaders/lib/light_path_sun.glsl)
const int PATH_TURNS = 3;    // is scattered forward on its way to the sun
const int PATH_SCATTERS = 4; // is scattered
const int PATH_LEAVES = 5;   // has left the layer's two spheres
const int PATH_ARRIVES = 6;  // has left them on its way to the sun
const int PATH_DONE = 7;

struct light_path {
	vec3 place; // m east, north, up from the camera's foot, on the plane that touches the Earth there
	vec3 direction;
	vec3 kept_place; // of the path while it looks for the sun
	vec3 kept_direction;
	int kept_mode;
	// The scattering that is to look for the sun: one of the last few, drawn in proportion to what it is expected to find.
	vec3 pick_place;
	vec3 pick_direction; // before it
	vec3 pick_ratio;
	float pick_worth; // what it is expected to find, and the sum of that over those it was drawn from; 0: none
	float pick_sum;
	float pick_passes; // share of the sun's light that was expected there
	int pick_kind;
	bool pick_straight;
	float pick_bends;
	vec3 ratio; // density with which each band would have drawn the path, over the hero's
	vec3 share; // per band, what the densities do not hold: reflectances, the air before the first event
	int hero;
	int mode;
	int turns;     // scatterings beyond the forward peak so far
	bool first;    // nothing has been met yet
	bool straight; // nothing but forward scatterings so far
	float bends;   // sum of those, as path_bend counts them
	bool lifted;   // the last thing met was the ground
	int grounded;  // 0 never, 1 after cloud, 2 before any
	uint random;
	float top; // m above the base, of the cloud at this place
	int kind;  // of light (enum layer) that the search for the sun finds
	// Of the search for the sun.
	vec3 sun;      // what it brings per band
	float arc;     // m, way in the layer so far
	float next;    // m, where it is scattered next
	float weight;  // of the way up to there, as path_sun_weight counts it
	float reach;   // m, up to the end of the layer
	float behind;  // length over which ways that bend may go on there, over the reach
	float whole;   // of it as it is weighed
	ivec2 cloudy;  // parts of that way that are expected to lie in cloud, as a bit set; and near cloud
	vec2 looked;   // scales of the shares of forward scatterings that are looked for in those parts and elsewhere
	float mean;    // number of forward scatterings that is looked for
	int left;      // scatterings to come
	vec2 weighed;  // for ways of forward scatterings alone: the bend where the search began, and all bends of the way so far
	ivec2 chain;
	vec2 turn;     // cosine and sine of the angle by which the chain is turned about the sun
};

// --- random numbers: a Weyl sequence through a full mixing, so that each depends on pixel, sample, seed and its number alone ---

float path_random(INOUT(light_path) path)
{
	path.random += 0x9e3779b9u;
	return (float(noise_hash(path.random) >> 8u) + 0.5) * (1.0 / 16777216.0);
}

// The first numbers of a pixel's samples fill their ranges evenly: additive recurrence (Roberts 2018, R sequence in six dimensions), shifted at random.
float path_even(uint pixel, uint sample_number, uint dimension, uint alpha)
{
	return (float((noise_hash(pixel + dimension * 0x632be5abu) + sample_number * alpha) >> 8u) + 0.5) * (1.0 / 16777216.0);
}

// --- bands ---

float path_of_hero(vec3 values, int hero)
{
	return hero == 0 ? values.x : hero == 1 ? values.y : values.z;
}

// Weight per band of what a path finds; more: further densities per band over the hero's, not yet in the path's ratio.
vec3 path_weight(light_path path, vec3 more)
{
	vec3 density = path.ratio * more;
	return path.share * density / max(dot(PATH_HERO_SHARE, density), 1e-30);
}

// --- places ---

// Height above the ground.
float path_height(vec3 place)
{
	float q = place.z * (2.0 * EARTH_RADIUS + place.z) + place.x * place.x + place.y * place.y;
	return q / (sqrt(EARTH_RADIUS * EARTH_RADIUS + q) + EARTH_RADIUS);
}

vec3 path_up(vec3 place)
{
	return vec3(place.x, place.y, EARTH_RADIUS + place.z) / (EARTH_RADIUS + path_height(place));
}

vec2 path_tile(vec3 place)
{
	return (vec2(place) + vec2(camera_position) - vec2(cloud_drift)) / cloud_layer.z + field_warp(vec2(place) / cloud_layer.z);
}

float path_top(vec3 place)
{
	return textureLod(path_tops, path_tile(place), 0.0).x;
}

// The largest height around, for as far as a texel of the bounds reaches.
float path_bound(vec3 place)
{
	vec2 uv = path_tile(place);
	return texelFetch(path_bounds, ivec2(floor(uv * PATH_BOUNDS_SIZE)) & (int(PATH_BOUNDS_SIZE) - 1), 0).x;
}

float path_largest_extinction()
{
	return max(extinction.x, max(extinction.y, extinction.z));
}

// --- directions ---

// Sine and cosine of half the angle of a phase unit.
vec2 path_half_angle(float unit)
{
	float near = min(unit, 1.0 - unit) * 1.41421356;
	float far = sqrt(max(1.0 - near * near, 0.0));
	return unit < 0.5 ? vec2(near, far) : vec2(far, near);
}

// Two vectors square to a direction and each other (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
vec3 path_turned(vec3 direction, float cosine, float sine, float around)
{
	float s = direction.z < 0.0 ? -1.0 : 1.0;
	float a = -1.0 / (s + direction.z);
	float b = direction.x * direction.y * a;
	vec3 x = vec3(1.0 + s * direction.x * direction.x * a, s * b, -s * direction.x);
	vec3 y = vec3(b, s + direction.y * direction.y * a, -direction.y);
	return normalize(direction * cosine + (x * cos(around) + y * sin(around)) * sine);
}

// Ways of forward scatterings alone are found from each of their scatterings, which sees the others drawn and looks at its own part of the peak. The balance heuristic would weigh by the
// inverse of the peak there; this stands for it, up to a factor, which is all that weights need to add up to one. half_sine: of half the angle.
const float PATH_BEND_LEAST = 0.002;

float path_bend(float half_sine)
{
	return half_sine * half_sine + PATH_BEND_LEAST * PATH_BEND_LEAST;
}

// Scatters: a new direction, drawn from the hero's phase function.
void path_scatter(INOUT(light_path) path, float share, float around)
{
	vec3 units = vec3(textureLod(phase_inverse, vec2((share * (PATH_INVERSE_SIZE - 1.0) + 0.5) / PATH_INVERSE_SIZE, 0.5), 0.0));
	vec2 half_angle = path_half_angle(path_of_hero(units, path.hero));
	vec3 phase = phase_full(half_angle);
	path.ratio *= phase / path_of_hero(phase, path.hero);
	bool forward = half_angle.x < FORWARD_PEAK_SINE;
	path.turns += forward ? 0 : 1;
	path.straight = path.straight && forward;
	path.bends += path_bend(half_angle.x);
	path.direction = path_turned(path.direction, 1.0 - 2.0 * half_angle.x * half_angle.x, 2.0 * half_angle.x * half_angle.y, 2.0 * PI * around);
}

// The clear sky that a path ends in, seen from the height where the table was made.
vec3 path_sky(sampler2D table, float table_height, vec3 place, vec3 direction)
{
	vec3 up = path_up(place);
	vec3 sun = vec3(sun_direction);
	float mu = clamp(dot(up, direction), -1.0, 1.0);
	float mu_sun = clamp(dot(up, sun), -1.0, 1.0);
	float cosine = (dot(direction, sun) - mu * mu_sun) * inversesqrt(max((1.0 - mu * mu) * (1.0 - mu_sun * mu_sun), 1e-12));
	return vec3(textureLod(table, sky_table_at(sphere_horizon(table_height), mu, true, cosine), 0.0));
}
#endif
