// Noise over the ground that never repeats, at any scale, with its derivatives.
#ifndef SHADERS_LIB_GROUND_LATTICE
#define SHADERS_LIB_GROUND_LATTICE
#include "shaders/lib/noise.glsl"

// A lattice of a given size of cell: cells of the camera's foot and the place relative to it, so that single precision keeps centimetres far from the origin.
struct ground_lattice {
	ivec2 cell;
	vec2 inside; // 0..1
};

ground_lattice ground_lattice_at(vec2 foot, vec2 offset, vec2 size)
{
	vec2 start = foot / size;
	vec2 base = floor(start);
	vec2 p = start - base + offset / size;
	vec2 cell = floor(p);
	ground_lattice at;
	at.cell = ivec2(int(cell.x) + int(base.x), int(cell.y) + int(base.y));
	at.inside = p - cell;
	return at;
}

// A gradient within the square of -1..1.
vec2 ground_gradient(int x, int y, uint seed)
{
	uint h = noise_hash2(x, y, seed);
	return vec2(float(h & 0xffffu), float(h >> 16u)) * (2.0 / 65535.0) - 1.0;
}

// Gradient noise of deviation about 1 and its derivatives over the lattice: x, y derivatives, z value.
vec3 ground_noise(ground_lattice at, uint seed)
{
	vec2 f = at.inside;
	vec2 w = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
	vec2 dw = 30.0 * f * f * (f * (f - 2.0) + 1.0);
	vec2 ga = ground_gradient(at.cell.x, at.cell.y, seed);
	vec2 gb = ground_gradient(at.cell.x + 1, at.cell.y, seed);
	vec2 gc = ground_gradient(at.cell.x, at.cell.y + 1, seed);
	vec2 gd = ground_gradient(at.cell.x + 1, at.cell.y + 1, seed);
	float a = dot(ga, f);
	float b = dot(gb, f - vec2(1.0, 0.0));
	float c = dot(gc, f - vec2(0.0, 1.0));
	float d = dot(gd, f - vec2(1.0, 1.0));
	vec2 slope = mix(mix(ga, gb, w.x), mix(gc, gd, w.x), w.y) + dw * vec2(mix(b - a, d - c, w.y), mix(c - a, d - b, w.x));
	// 1.96 and 5.7 bring the deviations of derivatives and value to 1.
	return vec3(1.96 * slope, 5.7 * mix(mix(a, b, w.x), mix(c, d, w.x), w.y));
}
#endif
