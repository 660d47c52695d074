// Deterministic noise on periodic lattices that lives in time instead of sliding (Perlin and Neyret 2001, "Flow Noise").
#ifndef SHADERS_LIB_NOISE
#define SHADERS_LIB_NOISE
#include "shaders/lib/scene_block.glsl"

// Integer hash with full avalanche (Wellons 2018, "lowbias32").
uint noise_hash(uint x)
{
	x ^= x >> 16u;
	x *= 0x7feb352du;
	x ^= x >> 15u;
	x *= 0x846ca68bu;
	x ^= x >> 16u;
	return x;
}

// Of a lattice point: the odd constants (Weyl sequences) keep neighbours apart before the one full mixing.
uint noise_hash2(int x, int y, uint seed)
{
	return noise_hash(uint(x) * 0x9e3779b1u + uint(y) * 0x85ebca77u + seed * 0xc2b2ae3du);
}

// 0..1
float noise_unit(uint hash)
{
	return float(hash >> 8u) * (1.0 / 16777216.0);
}

// i modulo period, never negative. By floats, since processors have no vector division of integers; exact for |i| below 2^22.
int noise_wrap(int i, int period)
{
	return i - period * int(floor((float(i) + 0.5) / float(period)));
}

// One lattice gradient's contribution; the gradient turns with time, each at a speed of its own.
float noise_corner(int x, int y, int period, uint seed, float turns, vec2 offset)
{
	uint h = noise_hash2(noise_wrap(x, period), noise_wrap(y, period), seed);
	// Upper bits say where the gradient starts, lower ones which way and how fast it turns.
	float speed = (float(h & 127u) * (0.8 / 127.0) + 0.6) * ((h & 128u) == 0u ? -1.0 : 1.0);
	float angle = 2.0 * PI * (noise_unit(h) + speed * turns);
	return dot(vec2(cos(angle), sin(angle)), offset);
}

// Gradient noise on a lattice of unit cells that repeats after `period` cells. turns: how often gradients have turned.
float noise_gradient(vec2 p, int period, uint seed, float turns)
{
	vec2 cell = floor(p);
	vec2 f = p - cell;
	int x = int(cell.x);
	int y = int(cell.y);
	vec2 w = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
	float a = noise_corner(x, y, period, seed, turns, f);
	float b = noise_corner(x + 1, y, period, seed, turns, f - vec2(1.0, 0.0));
	float c = noise_corner(x, y + 1, period, seed, turns, f - vec2(0.0, 1.0));
	float d = noise_corner(x + 1, y + 1, period, seed, turns, f - vec2(1.0, 1.0));
	// 3.9 brings the variance to 0.71, so that hardly a value lies outside -2..2; the weights of the fields are chosen with it.
	return 3.9 * mix(mix(a, b, w.x), mix(c, d, w.x), w.y);
}

// Sum of octaves from `period` cells a tile, each twice as fine; gain 2^(-1/3) an octave is the k^(-8/3) spectrum in the plane (k^(-5/3) along a line)
// of liquid water in stratiform cloud. Variance 0.71, whatever the number of octaves. p in tiles. Small eddies turn faster, as size to the power of 2/3.
float noise_turbulence(vec2 p, int period, int octaves, uint seed, float turns)
{
	float sum = 0.0;
	float weight = 1.0;
	float power = 0.0;
	for (int i = 0; i < octaves; i++) {
		// A shift of its own for each octave keeps their lattices apart.
		vec2 shift = vec2(noise_unit(noise_hash(seed + 31u * uint(i))), noise_unit(noise_hash(seed + 57u * uint(i) + 11u)));
		sum += weight * noise_gradient((p + shift) * float(period), period, seed + 101u * uint(i), turns);
		power += weight * weight;
		weight *= 0.7937;
		turns *= 1.5874;
		period *= 2;
	}
	return sum / sqrt(power);
}

// Of things that live one life after the other, each born at its own moment: in which life the one of this hash is, mixed into the hash, and how far (0..1).
// whole, fraction: lives that a thing of phase 0 has had, in two parts so that no time is too late for single precision.
struct noise_life {
	uint hash;
	float age;
};

noise_life noise_life_of(uint hash, float whole, float fraction)
{
	float age = fraction + noise_unit(hash);
	float later = step(1.0, age);
	noise_life life;
	life.hash = hash + uint(int(whole) + int(later)) * 0x9e3779b1u;
	life.age = age - later;
	return life;
}

// A value at a lattice point: mean 0, variance 1, skewed to few high ones among many low ones, as cloud is made of lumps.
float noise_lump(uint hash)
{
	float u = noise_unit(hash);
	// u^2 has mean 1/3 and variance 4/45.
	return (u * u - 1.0 / 3.0) * 3.354102;
}

// The value of a lattice point that fades from one life's into the next one's, at constant variance.
float noise_living(uint hash, float whole, float fraction)
{
	noise_life life = noise_life_of(hash, whole, fraction);
	float share = life.age * life.age * (3.0 - 2.0 * life.age);
	float rest = 1.0 - share;
	return (rest * noise_lump(noise_hash(life.hash)) + share * noise_lump(noise_hash(life.hash + 0x9e3779b1u))) * inversesqrt(rest * rest + share * share);
}

// Squared distances to the nearest and second nearest centre of cells. Each centre grows, shrinks and comes again elsewhere, one life after the other, and is
// farther away from everything by up to 1 while it is weak. Neither is more than 1, beyond which centres may lie that were not looked at. p in lattice cells,
// repeating after `period`; scatter: 0 on a lattice, 1 anywhere.
vec2 noise_centres(vec2 p, int period, uint seed, float whole, float fraction, float scatter)
{
	vec2 cell = floor(p);
	float first = 1.0;
	float second = 1.0;
	for (int dy = -1; dy <= 1; dy++) {
		for (int dx = -1; dx <= 1; dx++) {
			int x = int(cell.x) + dx;
			int y = int(cell.y) + dy;
			noise_life life = noise_life_of(noise_hash2(noise_wrap(x, period), noise_wrap(y, period), seed), whole, fraction);
			uint place = noise_hash(life.hash);
			vec2 jitter = vec2(float(place & 0xffffu), float(place >> 16u)) * (1.0 / 65536.0) - 0.5;
			vec2 away = vec2(float(x), float(y)) + 0.5 + scatter * jitter - p;
			float weakness = 1.0 - smoothstep(0.0, 0.25, life.age) * (1.0 - smoothstep(0.75, 1.0, life.age));
			float distance = dot(away, away) + weakness;
			second = min(second, max(first, distance));
			first = min(first, distance);
		}
	}
	return vec2(first, second);
}

// The point of a lattice that stands for all those a whole number of tiles away. lattice: a matrix by rows, which takes tiles to cells, of whole numbers
// and with a positive determinant, the number of cells a tile. Exact while both are below some hundred thousands.
vec2 noise_lattice_wrap(vec2 point, vec4 lattice)
{
	float cells = lattice.x * lattice.w - lattice.y * lattice.z;
	float u = floor((lattice.w * point.x - lattice.y * point.y + 0.5) / cells);
	float v = floor((lattice.x * point.y - lattice.z * point.x + 0.5) / cells);
	return point - vec2(lattice.x * u + lattice.y * v, lattice.z * u + lattice.w * v);
}

// Lumps that run together, 0..1 or so: a power of a sum of bells about the points of a lattice, each of which wanders from one life's place to the next one's
// and grows or shrinks meanwhile. p in lattice cells, repeating as noise_lattice_wrap says; scatter: 0 on a lattice, 1 anywhere; spread: of their sizes.
float noise_tufts(vec2 p, vec4 lattice, uint seed, float whole, float fraction, float scatter, float spread)
{
	vec2 cell = floor(p);
	float sum = 0.0;
	for (int dy = -1; dy <= 1; dy++) {
		for (int dx = -1; dx <= 1; dx++) {
			vec2 corner = cell + vec2(float(dx), float(dy));
			vec2 point = noise_lattice_wrap(corner, lattice);
			noise_life life = noise_life_of(noise_hash2(int(point.x), int(point.y), seed), whole, fraction);
			uint now = noise_hash(life.hash);
			uint next = noise_hash(life.hash + 0x9e3779b1u);
			float share = life.age * life.age * (3.0 - 2.0 * life.age);
			vec3 here = vec3(float(now & 0x7ffu), float(now >> 11u & 0x7ffu), float(now >> 22u) * 2.0);
			vec3 there = vec3(float(next & 0x7ffu), float(next >> 11u & 0x7ffu), float(next >> 22u) * 2.0);
			vec3 random = mix(here, there, share) * (1.0 / 2048.0);
			vec2 away = corner + 0.5 + scatter * (vec2(random.x, random.y) - 0.5) - p;
			sum += exp(-10.0 * (dot(away, away) + spread * random.z));
		}
	}
	return sqrt(sqrt(sum));
}
#endif
