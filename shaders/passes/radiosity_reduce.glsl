// One level of two planes' pyramids out of the level below: 1 3 3 1 along both axes. Planes are periodic. arguments[0].x: side of the level below.
// The plain mean of four texels would let detail through that the coarser level shows as something larger (aliases), up to 0.08 of an emitter's value.
#include "shaders/lib/scene_block.glsl"

uniform sampler2D first_below;
uniform sampler2D second_below;

vec3 reduced(sampler2D below, ivec2 pixel, int side)
{
	vec3 sum = vec3(0.0);
	for (int y = -1; y <= 2; y++) {
		for (int x = -1; x <= 2; x++) {
			ivec2 at = (pixel * 2 + ivec2(x, y) + side) & (side - 1); // side is a power of two
			float weight = (x == 0 || x == 1 ? 0.375 : 0.125) * (y == 0 || y == 1 ? 0.375 : 0.125);
			sum += weight * vec3(texelFetch(below, at, 0));
		}
	}
	return sum;
}

void pass(ivec2 pixel)
{
	int side = int(arguments[0].x);
	STORE(0, vec4(reduced(first_below, pixel, side), 1.0));
	STORE(1, vec4(reduced(second_below, pixel, side), 1.0));
}
