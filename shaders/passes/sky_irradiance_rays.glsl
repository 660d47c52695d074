// Radiance of the clear sky over the upper hemisphere, weighted for its irradiance on a horizontal plane: columns over azimuth, rows over the cosine of the
// zenith angle, in which radiance times cosine is smooth down to the horizon. arguments[0].x: height, m.
#include "shaders/lib/scattering.glsl"

const vec2 RAYS_SIZE = vec2(16.0, 16.0);

void pass(ivec2 pixel)
{
	float h = arguments[0].x;
	vec2 unit = (vec2(pixel) + 0.5) / RAYS_SIZE;
	float mu = unit.y;
	float mu_sun = sun_direction.z;
	float cos_angle = mu * mu_sun + sqrt(1.0 - mu * mu) * sqrt(max(0.0, 1.0 - mu_sun * mu_sun)) * cos(PI * unit.x);
	airlight light = scattering_walk(airlight_start(), h, mu, mu_sun, cos_angle, 0.0, sphere_distance_up(h, mu, ATMOSPHERE_HEIGHT), 10);
	STORE(0, vec4(light.radiance * (2.0 * PI * mu), 1.0));
}
