// Scattering of second and higher order for unit solar irradiance (Hillaire 2020, section 5.5): light gathered over the sphere after one scattering, divided
// by 1 - the share of isotropic light that air and ground send back.
#include "shaders/lib/sunlight.glsl"

const int DIRECTIONS = 8; // a side: 64 directions
const int STEPS = 24;

void pass(ivec2 pixel)
{
	vec2 parameters = multiscatter_parameters((vec2(pixel) + 0.5) / MULTISCATTER_SIZE);
	float h = min(parameters.x, ATMOSPHERE_HEIGHT - 1.0);
	float mu_sun = parameters.y;
	vec3 sun = vec3(sqrt(max(0.0, 1.0 - mu_sun * mu_sun)), 0.0, mu_sun);

	vec3 gathered = vec3(0.0);
	vec3 returned = vec3(0.0);
	for (int i = 0; i < DIRECTIONS * DIRECTIONS; i++) {
		float mu = 1.0 - 2.0 * (float(i / DIRECTIONS) + 0.5) / float(DIRECTIONS);
		float azimuth = 2.0 * PI * (float(i - i / DIRECTIONS * DIRECTIONS) + 0.5) / float(DIRECTIONS);
		vec3 direction = vec3(sqrt(1.0 - mu * mu) * vec2(cos(azimuth), sin(azimuth)), mu);
		float cos_angle = dot(direction, sun);

		float to_ground = sphere_distance_down(h, mu, 0.0);
		bool hits = to_ground >= 0.0;
		float end = hits ? to_ground : sphere_distance_up(h, mu, ATMOSPHERE_HEIGHT);
		vec3 passed = vec3(1.0);
		float previous = 0.0;
		for (int k = 0; k < STEPS; k++) {
			float unit = float(k + 1) / float(STEPS);
			float next = end * unit * unit;
			float t = 0.5 * (previous + next);
			float dt = next - previous;
			previous = next;
			float height = max(0.0, sphere_height(h, mu, t));
			float mu_here = clamp((mu_sun * (EARTH_RADIUS + h) + t * cos_angle) / (EARTH_RADIUS + height), -1.0, 1.0);
			vec3 extinction_here = max(atmosphere_extinction(height), vec3(1e-12));
			vec3 scattering_r = atmosphere_rayleigh(height);
			vec3 scattering_a = atmosphere_aerosol(height) * aerosol_shape.x;
			vec3 step_passed = exp(-extinction_here * dt);
			vec3 weight = passed * (vec3(1.0) - step_passed) / extinction_here;
			gathered += weight * sun_transmittance(height, mu_here) *
			            (scattering_r * phase_rayleigh(cos_angle) + scattering_a * phase_aerosol(cos_angle, aerosol_shape.y));
			returned += weight * (scattering_r + scattering_a);
			passed *= step_passed;
		}
		if (hits) {
			float mu_here = clamp((mu_sun * (EARTH_RADIUS + h) + end * cos_angle) / EARTH_RADIUS, -1.0, 1.0);
			gathered += passed * vec3(ground_mean_albedo) * max(mu_here, 0.0) * sun_transmittance(0.0, mu_here) / PI;
		}
	}
	float count = float(DIRECTIONS * DIRECTIONS);
	// The mean over the sphere of radiance is what an isotropic scatterer sends on per steradian.
	STORE(0, vec4(gathered / count / (vec3(1.0) - min(returned / count, vec3(0.99))), 1.0));
}
