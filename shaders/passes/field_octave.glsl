// One octave of a sum of noise: a value that lives at each lattice point, added to the sum of the coarser octaves, which cubic splines interpolate.
// arguments[0]: points a side; weight; lives so far: whole, fraction. [1]: shift of the coarser octaves, tiles; seed; side of the shape, or mean of the second sum. [2]: weights of vectors; or tiles by which a density of 1 shifts the shape.
// OCTAVE_FIRST: no coarser ones. OCTAVE_VECTOR: four sums at once. OCTAVE_LAST: on top of the shape.
#include "shaders/lib/bicubic.glsl"
#include "shaders/lib/noise.glsl"

#if !OCTAVE_FIRST
uniform sampler2D coarser;
#endif
#if OCTAVE_LAST
uniform sampler2D shape;
#endif

void pass(ivec2 pixel)
{
	uint hash = noise_hash2(pixel.x, pixel.y, uint(arguments[1].z));
	vec2 lives = vec2(arguments[0].z, arguments[0].w);
	vec2 uv = (vec2(pixel) + 0.5) / arguments[0].x;
#if OCTAVE_VECTOR
	vec4 value = arguments[2] * vec4(noise_living(hash, lives.x, lives.y), noise_living(hash ^ 0x68bc21ebu, lives.x, lives.y),
	                                 noise_living(hash ^ 0x02e5be93u, lives.x, lives.y), noise_living(hash ^ 0x967a889bu, lives.x, lives.y)) +
	             vec4(0.0, arguments[1].w, 0.0, 0.0);
#else
	vec4 value = vec4(arguments[0].y * noise_living(hash, lives.x, lives.y), 0.0, 0.0, 0.0);
#endif
#if !OCTAVE_FIRST
	value += bicubic_sample(coarser, uv - vec2(arguments[1]), 0.5 * arguments[0].x);
#endif
#if OCTAVE_LAST
	value += bicubic_sample(shape, uv + arguments[2].x * value.x * vec2(1.0, 0.6), arguments[1].w);
#endif
	STORE(0, value);
}
