// Light scattered towards a point by the air along a ray.
#ifndef SHADERS_LIB_SCATTERING
#define SHADERS_LIB_SCATTERING
#include "shaders/lib/sunlight.glsl"

#ifndef __cplusplus
uniform sampler2D multiscatter_table;
#endif

struct airlight {
	vec3 radiance;      // gathered so far, W/m2/nm/sr
	vec3 transmittance; // of the air passed so far
};

// Source of light scattered once and oftener at a point: radiance per metre, for unit phase functions `once` of both constituents.
vec3 scattering_source(float h, float mu_sun, float phase_r, float phase_a)
{
	vec3 scattering_r = atmosphere_rayleigh(h);
	vec3 scattering_a = atmosphere_aerosol(h) * aerosol_shape.x;
	vec3 again = vec3(textureLod(multiscatter_table, multiscatter_coordinates(h, mu_sun), 0.0));
	return vec3(solar_irradiance) *
	       (sun_transmittance(h, mu_sun) * (scattering_r * phase_r + scattering_a * phase_a) + again * (scattering_r + scattering_a));
}

// Walks a ray from height h, cosine mu, from distance `from` to `to`, adding to `light`. mu_sun0 is the cosine of the sun's zenith angle at the start of the
// ray, cos_angle that between ray and sun. Steps grow with the square of their number, since what is near weighs most.
airlight scattering_walk(airlight light, float h, float mu, float mu_sun0, float cos_angle, float from, float to, int steps)
{
	float phase_r = phase_rayleigh(cos_angle);
	float phase_a = phase_aerosol(cos_angle, aerosol_shape.y);
	float previous = from;
	for (int i = 0; i < steps; i++) {
		float unit = float(i + 1) / float(steps);
		float next = from + (to - from) * unit * unit;
		float t = 0.5 * (previous + next);
		float dt = next - previous;
		previous = next;
		float height = max(0.0, sphere_height(h, mu, t));
		// The vertical turns along the ray: cosine of the sun there.
		float mu_sun = clamp((mu_sun0 * (EARTH_RADIUS + h) + t * cos_angle) / (EARTH_RADIUS + height), -1.0, 1.0);
		vec3 extinction_here = max(atmosphere_extinction(height), vec3(1e-12));
		vec3 passed = exp(-extinction_here * dt);
		light.radiance += light.transmittance * scattering_source(height, mu_sun, phase_r, phase_a) * (vec3(1.0) - passed) / extinction_here;
		light.transmittance *= passed;
	}
	return light;
}
#endif
