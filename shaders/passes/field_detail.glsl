// Detail below the texel of the coarse field, over a small tile of its own, continuing the same spectrum.
#include "shaders/lib/noise.glsl"

void pass(ivec2 pixel)
{
	vec2 p = (vec2(pixel) + 0.5) / arguments[0].x;
	STORE(0, vec4(noise_turbulence(p, 14, 6, uint(cloud_field.x) + 77u, cloud_field.z / 400.0), 0.0, 0.0, 1.0));
}
