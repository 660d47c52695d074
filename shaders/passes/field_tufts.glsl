// A layer of tufts of cloud, on top of the layers before. Mesoscale variation and warp come from four slow sums of noise.
// arguments[0]: lattice of the tufts (noise_lattice_wrap). [1]: points a side; seed; lives so far: whole, fraction. [2]: weights of tufts and of rolls; scatter
// of the tufts; spread of their sizes. [3]: warp in cells; added to how open they are.
#include "shaders/lib/bicubic.glsl"
#include "shaders/lib/noise.glsl"

uniform sampler2D slow;
uniform sampler2D before;

void pass(ivec2 pixel)
{
	vec2 uv = (vec2(pixel) + 0.5) / arguments[1].x;
	vec4 field = bicubic_sample(slow, uv, float(textureSize(slow, 0).x));
	float value = bicubic_sample(before, uv, float(textureSize(before, 0).x)).x;

	vec4 lattice = arguments[0];
	vec2 place = vec2(dot(vec2(lattice.x, lattice.y), uv), dot(vec2(lattice.z, lattice.w), uv)) + arguments[3].x * vec2(field.z, field.w);
	float tufts = noise_tufts(place, lattice, uint(arguments[1].y), arguments[1].z, arguments[1].w, arguments[2].z, arguments[2].w);
	// Here tufts stand apart, there their rows join in rolls.
	float joined = clamp(field.y + arguments[3].y, 0.0, 1.0);
	value += arguments[2].x * (1.4 - 0.8 * joined) * tufts - arguments[2].y * joined * cos(2.0 * PI * place.y);
	STORE(0, vec4(value, 0.0, 0.0, 1.0));
}
