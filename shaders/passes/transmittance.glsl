// Transmittance of the air from a height along a direction to the top of the atmosphere.
#include "shaders/lib/atmosphere.glsl"

void pass(ivec2 pixel)
{
	vec2 parameters = transmittance_parameters((vec2(pixel) + 0.5) / TRANSMITTANCE_SIZE);
	float distance = max(0.0, sphere_distance_up(parameters.x, parameters.y, ATMOSPHERE_HEIGHT));
	STORE(0, vec4(exp(-atmosphere_optical_thickness(parameters.x, parameters.y, distance, 128)), 1.0));
}
