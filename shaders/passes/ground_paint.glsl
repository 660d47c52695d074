// Picture of the ground over one tile. arguments[0].x: its side in texels.
#include "shaders/lib/ground_paint.glsl"

void pass(ivec2 pixel)
{
	STORE(0, vec4(ground_paint((vec2(pixel) + 0.5) / arguments[0].x), 1.0));
}
