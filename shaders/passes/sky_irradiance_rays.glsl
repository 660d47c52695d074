// Radiance of the clear sky over the upper hemisphere, weighted for its irradiance on a horizontal plane: columns over azimuth, rows over the sine squared
// of the zenith angle. arguments[0].x: height, m.
#include "shaders/lib/scattering.glsl"

const vec2 RAYS_SIZE = vec2(16.0, 16.0);

void pass(ivec2 pixel)
{
	float h = arguments[0].x;
	vec2 unit = (vec2(pixel) + 0.5) / RAYS_SIZE;
	float mu = sqrt(1.0 - unit.y);
	float mu_sun = sun_direction.z;
	float cos_angle = mu * mu_sun + sqrt(unit.y) * sqrt(max(0.0, 1.0 - mu_sun * mu_sun)) * cos(PI * unit.x);
	airlight light;
	light.radiance = vec3(0.0);
	light.transmittance = vec3(1.0);
	light = scattering_walk(light, h, mu, mu_sun, cos_angle, 0.0, sphere_distance_up(h, mu, ATMOSPHERE_HEIGHT), 40);
	STORE(0, vec4(light.radiance * PI, 1.0));
}
