// How a light path finds the sun.
//
// Droplets scatter half of all light by less than 5 degrees. Looking from every scattering straight at the sun would find, once in a thousand times, one that scatters into
// the middle of that peak, and leave a bright speck. So light is sorted by its last scattering beyond the peak, seen from the camera: from there on it goes to the sun by
// forward scatterings alone, and that rest is drawn from the sun's side, where its directions come of the peak itself. What is left to evaluate is the phase function
// outside the peak. Paths that met nothing but forward scatterings (order 0) have to look at the sun through the peak: from each of these, the rest drawn from the sun's side all the same,
// and weighed so that the one that bends the way most counts most, which is hardly ever in the middle of the peak (path_bend).
//
// Number and places of the forward scatterings are drawn for the cloud that is expected towards the sun, those places a Poisson process on the way; what cloud there
// really is decides about their weight, and ratio tracking (Novak, Selle and Jarosz 2014, "Residual Ratio Tracking") about what the way lets through beside.
#ifndef SHADERS_LIB_LIGHT_PATH_SUN
#define SHADERS_LIB_LIGHT_PATH_SUN
#include "shaders/lib/light_path.glsl"

// The table of chains: so many of them, each with so many directions, from the sun's disc (0) on backwards, texel by texel; a row holds 64 chains, each hero has as many rows. x, y: sine
// from the middle of the sun along two axes; z, w: densities of the next two bands, in turn, over the hero's.
const int PATH_CHAIN_LENGTH = 16;
const int PATH_CHAIN_ROWS = 64;
// The way to the sun is looked at in so many parts, short ones first.
const int PATH_PARTS = 16;
const float PATH_PARTS_BEND = 12.0;
// Where no cloud is expected there may be some: share of the forward scatterings looked for near cloud, as far as ways stray from the straight one, and away from it. Every one of them that
// meets no cloud brings nothing, so that few are worth looking for; but what is found where few are looked for outshines the rest of the picture.
const float PATH_NEAR = 0.3;
const float PATH_AWAY = 0.015;
const float PATH_IN_VAIN = 1.5;
const float PATH_BEND = 0.1; // rad, by which ways bend at most; and mostly
const float PATH_STRAY = 0.05;
const float PATH_SURE = 4.0; // optical thickness
const float PATH_MOST = 6.0;

// Where a part begins, over the whole way; and the part at a place.
float path_part_start(int part)
{
	return float(part) * (float(part) + PATH_PARTS_BEND) * (1.0 / (float(PATH_PARTS) * (float(PATH_PARTS) + PATH_PARTS_BEND)));
}

int path_part_at(float way)
{
	float middle = 0.5 * PATH_PARTS_BEND;
	return min(int(sqrt(middle * middle + float(PATH_PARTS) * (float(PATH_PARTS) + PATH_PARTS_BEND) * max(way, 0.0)) - middle), PATH_PARTS - 1);
}

bool path_part_cloudy(int cloudy, int part)
{
	return ((cloudy >> part) & 1) != 0;
}

// Is it so short that it lies in cloud as a whole, where its middle does? Only then cloud is counted on.
bool path_part_sure(light_path path, int part)
{
	float size = (path_part_start(part + 1) - path_part_start(part)) * path.reach;
	return path_part_cloudy(path.cloudy.x, part) && size * extinction.y < PATH_SURE;
}

// Share of the forward scatterings in cloud that are looked for in a part.
float path_part_share(ivec2 cloudy, vec2 looked, int part)
{
	return path_part_cloudy(cloudy.x, part) ? looked.x : looked.y * (path_part_cloudy(cloudy.y, part) ? PATH_NEAR : PATH_AWAY);
}

// The same behind the last part: ways that bend down leave the layer later than the straight one. It falls as an exponential, of a length in parts of the whole way.
float path_behind_length(float mu_sun)
{
	return clamp(PATH_BEND * inversesqrt(max(mu_sun * mu_sun, 1e-4)), 0.05, 1.0);
}

float path_share_at(light_path path, float way)
{
	float behind = path_part_share(path.cloudy, path.looked, PATH_PARTS) * exp(-max(way - 1.0, 0.0) / path.behind);
	return way < 1.0 ? path_part_share(path.cloudy, path.looked, path_part_at(way)) : behind;
}

// Draws where the path is scattered next: x of a uniform density over the rest of the ways as they are weighed.
void path_sun_draw_next(INOUT(light_path) path)
{
	float share = pow(path_random(path), 1.0 / float(max(path.left, 1)));
	path.weight = mix(path.whole, path.weight, share);
	float rest = path.weight;
	float at = -1.0;
	for (int i = 0; i < PATH_PARTS; i++) {
		float from = path_part_start(i);
		float size = path_part_start(i + 1) - from;
		float part_share = path_part_share(path.cloudy, path.looked, i);
		at = at < 0.0 && rest <= size * part_share ? from + rest / part_share : at;
		rest -= size * part_share;
	}
	float behind = path_part_share(path.cloudy, path.looked, PATH_PARTS) * path.behind;
	at = at < 0.0 ? 1.0 - path.behind * log(max(1.0 - rest / max(behind, 1e-9), 1e-6)) : at;
	path.next = path.left == 0 ? 1e9 : at * path.reach;
}

// The whole way and what may lie behind it, weighed, over its length.
float path_sun_whole(ivec2 cloudy, vec2 looked, float behind)
{
	float sum = path_part_share(cloudy, looked, PATH_PARTS) * behind;
	for (int i = 0; i < PATH_PARTS; i++)
		sum += (path_part_start(i + 1) - path_part_start(i)) * path_part_share(cloudy, looked, i);
	return sum;
}

vec4 path_sun_texel(light_path path)
{
	return texelFetch(forward_chains, path.chain + ivec2(path.left, 0), 0);
}

vec3 path_sun_direction(light_path path, vec4 texel)
{
	vec3 sun = vec3(sun_direction);
	float s = sun.z < 0.0 ? -1.0 : 1.0;
	float a = -1.0 / (s + sun.z);
	float b = sun.x * sun.y * a;
	vec3 x = vec3(1.0 + s * sun.x * sun.x * a, s * b, -s * sun.x);
	vec3 y = vec3(b, s + sun.y * sun.y * a, -sun.y);
	vec2 aside = vec2(texel.x * path.turn.x - texel.y * path.turn.y, texel.x * path.turn.y + texel.y * path.turn.x);
	return sun * sqrt(max(1.0 - dot(aside, aside), 0.0)) + x * aside.x + y * aside.y;
}

vec3 path_sun_ratio(light_path path, vec4 texel)
{
	return path.hero == 0 ? vec3(1.0, texel.z, texel.w) : path.hero == 1 ? vec3(texel.w, 1.0, texel.z) : vec3(texel.z, texel.w, 1.0);
}

// How far the layer reaches towards the sun from a place in it, m.
float path_sun_reach(float height, float mu_sun)
{
	float mu = mu_sun < 0.0 ? min(mu_sun, -0.01) : max(mu_sun, 0.01);
	return max(mu < 0.0 ? (cloud_layer.x - height) / mu : (cloud_layer.x + cloud_layer.y - height) / mu, 0.01);
}

// Looks at the straight way from a place to the sun: which parts of it lie in cloud (x), as far as light comes through, and which near it (y), the one behind the last among them.
// furthest: m of cloud.
ivec2 path_sun_look(vec3 place, float height, float mu_sun, float reach, float furthest)
{
	int cloudy = 0;
	int near = 0;
	float passed = 0.0;
	for (int i = 0; i < PATH_PARTS; i++) {
		float t = 0.5 * (path_part_start(i) + path_part_start(i + 1)) * reach;
		float over = height - cloud_layer.x + mu_sun * t;
		float top = path_top(place + vec3(sun_direction) * t);
		bool inside = passed < furthest && over >= 0.0 && over < top;
		cloudy |= inside ? 1 << i : 0;
		near |= top > 0.0 && over < top + PATH_STRAY * t ? 1 << i : 0;
		passed += inside ? (path_part_start(i + 1) - path_part_start(i)) * reach : 0.0;
	}
	return ivec2(cloudy, near | (cloudy << 1) | (cloudy >> 1));
}

// Begins to look for the sun. place: where the straight way to the sun enters the layer; height above ground, cosine of the sun there; ratio: densities of
// the path up to there; worth: what is at stake, over what comes through. The number of forward scatterings is drawn, and with it the direction to begin with. Returns what the way
// brings by itself, densities included, per band; 0: not worth looking.
vec3 path_sun_begin(INOUT(light_path) path, vec3 place, float height, float mu_sun, vec3 ratio, float worth)
{
	vec3 peak = vec3(extinction) - vec3(extinction_modified);
	float hero_peak = path_of_hero(peak, path.hero);
	path.reach = path_sun_reach(height, mu_sun);
	path.behind = path_behind_length(mu_sun);
	// What is looked for must not depend on the hero: the bands' densities would be of different ways.
	path.cloudy = path_sun_look(place, height, mu_sun, path.reach, PATH_MOST / peak.y);
	path.arc = 0.0;
	path.weight = 0.0;
	float expected = path_sun_whole(path.cloudy, vec2(1.0, 0.0), path.behind) * path.reach;
	// Long ways to a low sun lie in the open, or lead through so much cloud that light takes another: no more scatterings are looked for there than light makes.
	float in_vain = path_sun_whole(path.cloudy, vec2(0.0, 1.0), path.behind) * path.reach;
	path.looked = min(vec2(1.0), vec2(2.0 * PATH_MOST, PATH_IN_VAIN) / max(peak.y * vec2(expected, in_vain), vec2(1e-6)));
	path.whole = path_sun_whole(path.cloudy, path.looked, path.behind);

	float patience = clamp(worth * exp(-path_of_hero(vec3(extinction_modified), path.hero) * expected * min(10.0 * abs(mu_sun), 1.0)), 0.03, 1.0);
	bool looks = path_random(path) < patience;
	// Poisson's law by inversion.
	float way = path.whole * path.reach;
	path.mean = hero_peak * way;
	float term = exp(-path.mean);
	float sum = term;
	float share = path_random(path);
	int count = 0;
	for (int i = 1; i <= PATH_CHAIN_LENGTH; i++) {
		if (share > sum) {
			count = i;
			term *= path.mean / float(i);
			sum += term;
		}
	}
	path.left = min(count, PATH_CHAIN_LENGTH - 1);
	uint which = min(uint(path_random(path) * 4096.0), 4095u);
	float around = 2.0 * PI * path_random(path);
	path.chain = ivec2(int(which & 63u) * PATH_CHAIN_LENGTH, int(which >> 6u) + PATH_CHAIN_ROWS * path.hero);
	path.turn = vec2(cos(around), sin(around));
	vec4 texel = path_sun_texel(path);
	path.direction = path_sun_direction(path, texel);
	// More forward scatterings than a chain holds are left out: a share of 1e-5 of what gets through so much cloud at all.
	vec3 densities = path_sun_ratio(path, texel) * exp((vec3(hero_peak) - peak) * way);
	path_sun_draw_next(path);
	// Densities are over the hero's, whose own exp(-mean) stands in path_sun_arrives.
	vec3 own = path_sun_ratio(path, texel);
	vec3 weight = path.share * ratio * own / max(dot(PATH_HERO_SHARE, ratio * densities), 1e-30);
	return looks && count < PATH_CHAIN_LENGTH ? weight / patience : vec3(0.0);
}

// A free path of the search ends inside the cloud or outside of it. false when nothing is left.
bool path_sun_collides(INOUT(light_path) path, bool inside, float largest)
{
	bool expected = path.arc < path.reach && path_part_sure(path, path_part_at(path.arc / path.reach));
	vec3 factor = vec3(1.0) - vec3(extinction) * ((inside ? 1.0 : 0.0) - (expected ? 1.0 : 0.0)) / largest;
	// Where cloud is unexpected hardly anything is left.
	float most = clamp(max(factor.x, max(factor.y, factor.z)), 0.0, 1.0);
	path.sun *= factor / max(most, 1e-6);
	return path_random(path) < most;
}

// Out of the layer: what is left of path.sun. Cloud as it was expected on the way so far; path_sun_collides has weighed what else there was.
vec3 path_sun_arrives(light_path path)
{
	float way = path.arc / path.reach;
	float expected = 0.0;
	for (int i = 0; i < PATH_PARTS; i++)
		expected += path_part_sure(path, i) ? clamp(way - path_part_start(i), 0.0, path_part_start(i + 1) - path_part_start(i)) : 0.0;
	return path.left == 0 ? path.sun * (path.weighed.x / path.weighed.y) * exp(vec3(path.mean) - vec3(extinction) * (expected * path.reach)) : vec3(0.0);
}

// The next forward scattering, in cloud.
void path_sun_turns(INOUT(light_path) path)
{
	path.sun /= path_share_at(path, path.arc / path.reach);
	path.left = max(path.left - 1, 0);
	vec3 before = path.direction;
	path.direction = path_sun_direction(path, path_sun_texel(path));
	path.weighed.y += path.weighed.x < 1.0 ? path_bend(0.5 * length(path.direction - before)) : 0.0;
	path_sun_draw_next(path);
	path.mode = PATH_SUN;
}
#endif
