// Harmonics of the diffuse light in the air (shaders/lib/multiscatter.glsl), gathered over the sphere from what air and ground send there under sun and, after
// the first time (MULTISCATTER_AGAIN), under the light gathered before: each time adds an order of scattering. The first closes the orders to come as a
// geometric series by the share of isotropic light that air and ground send back (Hillaire 2020, section 5.5); those that follow correct that.
// MULTISCATTER_GROUND: the irradiance of the ground instead, a row over the sun's height.
#include "shaders/lib/multiscatter.glsl"

#ifndef __cplusplus
uniform sampler2D ground_irradiance;
#endif

const int AZIMUTHS = 4; // over half the circle
const int GROUPS = 6;
const int SHARE = 2; // steps that take the diffuse light of one place

// Four nodes of Gauss and Legendre on 0..1: x abscissa, y weight.
vec2 gauss_node(int i)
{
	return i == 0 ? vec2(0.0694318442, 0.1739274226)
	              : i == 1 ? vec2(0.3300094782, 0.3260725774) : i == 2 ? vec2(0.6699905218, 0.3260725774) : vec2(0.9305681558, 0.1739274226);
}

// Steps along a ray, 0..1: denser at its start, and at its end where that is the ground.
float step_at(float unit, bool hits)
{
	return unit * unit * (hits ? 3.0 - 2.0 * unit : 1.0);
}

void pass(ivec2 pixel)
{
	// The row of the ground is the first of the table.
	vec2 parameters = multiscatter_parameters((vec2(pixel) + 0.5) / MULTISCATTER_SIZE);
	float h = parameters.x;
	float mu_sun0 = parameters.y;
	float sine_sun = sqrt(max(0.0, 1.0 - mu_sun0 * mu_sun0));
	float horizon = sphere_horizon(h);
	float share_left = aerosol_smooth_moments(aerosol_shape.y).x;
	float forward = 1.0 - aerosol_shape.x * (1.0 - share_left);

	vec3 mean = vec3(0.0);
	vec3 moment_1 = vec3(0.0);
	vec3 moment_2 = vec3(0.0);
	vec3 moment_3 = vec3(0.0);
	vec3 moment_4 = vec3(0.0);
	vec3 moment_5 = vec3(0.0);
	vec3 moment_6 = vec3(0.0);
	vec3 moment_7 = vec3(0.0);
	vec3 moment_8 = vec3(0.0);
	vec3 moment_9 = vec3(0.0);
	vec3 flux = vec3(0.0); // from above, on a horizontal plane
	vec3 returned = vec3(0.0);
	for (int i = 0; i < 8 * AZIMUTHS; i++) {
		int row = i / AZIMUTHS;
		bool hits = row >= 4;
		vec2 node = gauss_node(hits ? row - 4 : row);
		float mu = hits ? horizon - (1.0 + horizon) * node.x : horizon + (1.0 - horizon) * node.x;
		float weight = 0.5 * node.y * (hits ? 1.0 + horizon : 1.0 - horizon) / float(AZIMUTHS);
		float azimuth = PI * (float(i - row * AZIMUTHS) + 0.5) / float(AZIMUTHS);
		float ahead = sqrt(max(0.0, 1.0 - mu * mu)) * cos(azimuth);
		float cos_angle = mu * mu_sun0 + ahead * sine_sun;
		float phase_r = phase_rayleigh(cos_angle);
		float phase_a = phase_aerosol_smooth(cos_angle, aerosol_shape.y);
		float end = hits ? max(sphere_distance_down(h, mu, 0.0), 0.0) : sphere_distance_up(h, mu, ATMOSPHERE_HEIGHT);

		vec3 radiance = vec3(0.0);
		vec3 passed = vec3(1.0);
		float previous = 0.0;
		for (int k = 0; k < GROUPS; k++) {
#if MULTISCATTER_AGAIN
			float at = end * step_at((float(k) + 0.5) / float(GROUPS), hits);
			float place = max(0.0, sphere_height(h, mu, at));
			float sun_there = clamp((mu_sun0 * (EARTH_RADIUS + h) + at * cos_angle) / (EARTH_RADIUS + place), -1.0, 1.0);
			float up = sphere_cosine(h, mu, at, place);
			diffuse_radiance diffuse = multiscatter_seen(place, sun_there, up, multiscatter_ahead(up, sun_there, cos_angle));
#endif
			for (int j = 1; j <= SHARE; j++) {
				float next = end * step_at(float(k * SHARE + j) / float(GROUPS * SHARE), hits);
				float t = 0.5 * (previous + next);
				float dt = next - previous;
				previous = next;
				float height = max(0.0, sphere_height(h, mu, t));
				float mu_sun = clamp((mu_sun0 * (EARTH_RADIUS + h) + t * cos_angle) / (EARTH_RADIUS + height), -1.0, 1.0);
				vec3 scattering_r = atmosphere_rayleigh(height);
				vec3 haze = atmosphere_aerosol(height);
				vec3 scattering_a = haze * aerosol_shape.x;
				vec3 scaled = max(scattering_r + vec3(ozone) * ozone_profile(height) + haze * forward, vec3(1e-12));
				vec3 step_passed = exp(-scaled * dt);
				vec3 share = passed * (vec3(1.0) - step_passed) / scaled;
				vec3 direct = sun_transmittance_scaled(height, mu_sun);
#if MULTISCATTER_AGAIN
				radiance += share * (scattering_r * (direct * phase_r + diffuse.rayleigh) +
				                     scattering_a * (direct * phase_a + diffuse.aerosol));
#else
				radiance += share * direct * (scattering_r * phase_r + scattering_a * phase_a);
				returned += weight * share * (scattering_r + scattering_a * share_left);
#endif
				passed *= step_passed;
			}
		}
		if (hits) {
			float mu_sun = clamp((mu_sun0 * (EARTH_RADIUS + h) + end * cos_angle) / EARTH_RADIUS, -1.0, 1.0);
			vec3 received = sun_transmittance_scaled(0.0, mu_sun) * max(mu_sun, 0.0);
#if MULTISCATTER_AGAIN && !MULTISCATTER_GROUND
			received += vec3(textureLod(ground_irradiance, vec2(multiscatter_coordinates(0.0, mu_sun).x, 0.5), 0.0));
#else
			returned += weight * passed * vec3(ground_mean_albedo);
#endif
			radiance += passed * vec3(ground_mean_albedo) * received / PI;
		}
		radiance *= weight;
		float beside = max(0.0, 1.0 - mu * mu - ahead * ahead);
		vec3 second = harmonics_second(mu, ahead, beside);
		vec4 third = harmonics_third(mu, ahead, beside);
		mean += radiance;
		moment_1 += radiance * mu;
		moment_2 += radiance * ahead;
		moment_3 += radiance * second.x;
		moment_4 += radiance * second.y;
		moment_5 += radiance * second.z;
		moment_6 += radiance * third.x;
		moment_7 += radiance * third.y;
		moment_8 += radiance * third.z;
		moment_9 += radiance * third.w;
		flux += radiance * (4.0 * PI * max(mu, 0.0));
	}
#if MULTISCATTER_GROUND
	STORE(0, vec4(flux, 1.0));
#else
	mean = max(mean, vec3(MULTISCATTER_DARK));
	vec3 unit = vec3(1.0) / mean;
	moment_8 *= unit;
	moment_9 *= unit;
#if !MULTISCATTER_AGAIN
	mean /= vec3(1.0) - min(returned, vec3(0.9));
#endif
	STORE(0, vec4(log(mean), moment_8.x));
	STORE(1, vec4(moment_1 * unit, moment_8.y));
	STORE(2, vec4(moment_2 * unit, moment_8.z));
	STORE(3, vec4(moment_3 * unit, moment_9.x));
	STORE(4, vec4(moment_4 * unit, moment_9.y));
	STORE(5, vec4(moment_5 * unit, moment_9.z));
	STORE(6, vec4(moment_6 * unit, 0.0));
	STORE(7, vec4(moment_7 * unit, 0.0));
#endif
}
