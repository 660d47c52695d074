// Transmittance of the air from a height along a direction to the top of the atmosphere; w: the way through aerosol, in metres of its density at the ground.
#include "shaders/lib/atmosphere.glsl"

void pass(ivec2 pixel)
{
	vec2 parameters = transmittance_parameters((vec2(pixel) + 0.5) / TRANSMITTANCE_SIZE);
	float distance = max(0.0, sphere_distance_up(parameters.x, parameters.y, ATMOSPHERE_HEIGHT));
	vec4 thickness = atmosphere_optical_thickness(parameters.x, parameters.y, distance, 64);
	STORE(0, vec4(exp(-vec3(thickness)), thickness.w));
}
