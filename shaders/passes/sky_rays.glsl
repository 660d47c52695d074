// Radiance of the clear sky at the ground along single rays. The texel of `ray_table`: x cosine of the ray to the vertical, from 0; y to the sun.
#include "shaders/lib/scattering.glsl"

uniform sampler2D ray_table;

void pass(ivec2 pixel)
{
	vec4 ray = texelFetch(ray_table, pixel, 0);
	float distance = sphere_distance_up(0.0, ray.x, ATMOSPHERE_HEIGHT);
	STORE(0, vec4(scattering_walk(airlight_start(), 0.0, ray.x, sun_direction.z, ray.y, 0.0, distance, 20).radiance, 1.0));
}
