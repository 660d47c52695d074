// Tufts, clods and ripples: noise over a small tile. arguments[0].x: its side in texels.
#include "shaders/lib/noise.glsl"

void pass(ivec2 pixel)
{
	vec2 p = (vec2(pixel) + 0.5) / arguments[0].x;
	STORE(0, vec4(noise_turbulence(p, 5, 5, 45u, 0.0), 0.0, 0.0, 1.0));
}
