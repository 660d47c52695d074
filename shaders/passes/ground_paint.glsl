// Picture of the ground over one tile. arguments[0].x: its side in texels.
#include "shaders/lib/ground_paint.glsl"

void pass(ivec2 pixel)
{
	// Four samples a texel: hedges and leads are hardly wider than that.
	vec3 sum = vec3(0.0);
	for (int i = 0; i < 4; i++)
		sum += ground_paint((vec2(pixel) + vec2(float(i & 1), float(i >> 1)) * 0.5 + 0.25) / arguments[0].x);
	STORE(0, vec4(0.25 * sum, 1.0));
}
