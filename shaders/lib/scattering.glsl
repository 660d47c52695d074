// Light scattered towards a point by the air along a ray.
#ifndef SHADERS_LIB_SCATTERING
#define SHADERS_LIB_SCATTERING
#include "shaders/lib/multiscatter.glsl"

struct airlight {
	vec3 radiance;    // gathered so far, W/m2/nm/sr
	vec3 transmitted; // by the air passed so far, where the aerosol's forward peak counts as not scattered (delta-M)
	vec3 thickness;   // optical, of that air, all counted
	float haze;       // way through aerosol, in metres of its density at the ground
};

airlight airlight_start()
{
	airlight light;
	light.radiance = vec3(0.0);
	light.transmitted = vec3(1.0);
	light.thickness = vec3(0.0);
	light.haze = 0.0;
	return light;
}

const int SCATTERING_SHARE = 4; // steps that take the diffuse light of one place, which changes slowly

// Light of the beam seen scattered once by aerosol, or besides any number of times into its forward peak, over what delta-M scaling lets through and over the
// scattering coefficient. depth: optical thickness of the forward peak on the whole way, from the sun and on to the viewer. Nakajima and Tanaka's
// TMS (1988) takes the whole phase function at this place, which leaves the aureole of hazy air too bright; here the peak is spread with every
// forward event, which come in numbers that obey Poisson's law, spread over the way: events beyond the third go where light goes anyway.
vec3 scattering_by_aerosol(vec4 phase, float share_left, vec3 depth)
{
	vec3 none = exp(-depth);
	vec3 t = max(depth, vec3(1e-2));
	vec3 rest = max((vec3(1.0) - exp(-t)) / t - exp(-t) * (vec3(1.0) + t * (0.5 + t / 6.0)), vec3(0.0));
	return phase.x * (vec3(1.0) + rest * ((1.0 - share_left) / share_left)) + none * (phase.y + depth * (0.5 * phase.z + depth * (phase.w / 6.0)));
}

// Walks a ray from height h, cosine mu, from distance `from` to `to`, adding to `light`. mu_sun0 is the cosine of the sun's zenith angle at the start of the
// ray, cos_angle that between ray and sun. Steps grow with the square of their number, since what is near weighs most.
airlight scattering_walk(airlight light, float h, float mu, float mu_sun0, float cos_angle, float from, float to, int groups)
{
	float phase_r = phase_rayleigh(cos_angle);
	vec4 phase_a = phase_aerosol_parts(cos_angle, aerosol_shape.y);
	float share_left = aerosol_smooth_moments(aerosol_shape.y).x;
	float forward = 1.0 - aerosol_shape.x * (1.0 - share_left);
	vec3 peak = atmosphere_forward(0.0);
	float count = float(groups * SCATTERING_SHARE);
	float previous = from;
	for (int i = 0; i < groups; i++) {
		float middle = (float(i) + 0.5) / float(groups);
		float at = from + (to - from) * middle * middle;
		float height = max(0.0, sphere_height(h, mu, at));
		float mu_sun = clamp((mu_sun0 * (EARTH_RADIUS + h) + at * cos_angle) / (EARTH_RADIUS + height), -1.0, 1.0);
		float up = sphere_cosine(h, mu, at, height);
		diffuse_radiance diffuse = multiscatter_seen(height, mu_sun, up, multiscatter_ahead(up, mu_sun, cos_angle));
		for (int k = 1; k <= SCATTERING_SHARE; k++) {
			float unit = float(i * SCATTERING_SHARE + k) / count;
			float next = from + (to - from) * unit * unit;
			float t = 0.5 * (previous + next);
			float dt = next - previous;
			previous = next;
			height = max(0.0, sphere_height(h, mu, t));
			// The vertical turns along the ray: cosine of the sun there.
			mu_sun = clamp((mu_sun0 * (EARTH_RADIUS + h) + t * cos_angle) / (EARTH_RADIUS + height), -1.0, 1.0);
			float density = exp(-height / aerosol.w);
			vec3 haze = vec3(aerosol) * density;
			vec3 rest = atmosphere_rayleigh(height) + vec3(ozone) * ozone_profile(height);
			vec3 scaled = max(rest + haze * forward, vec3(1e-12));
			vec3 passed = exp(-scaled * dt);
			vec4 passage = sun_passage(height, mu_sun);
			vec3 direct = vec3(passage) * exp(min(peak * passage.w, vec3(60.0)));
			vec3 by_haze = scattering_by_aerosol(phase_a, share_left, peak * (passage.w + light.haze + 0.5 * density * dt));
			vec3 source = atmosphere_rayleigh(height) * (direct * phase_r + diffuse.rayleigh) +
			              haze * (aerosol_shape.x * (direct * by_haze + diffuse.aerosol));
			light.radiance += light.transmitted * vec3(solar_irradiance) * source * (vec3(1.0) - passed) / scaled;
			light.transmitted *= passed;
			light.thickness += (rest + haze) * dt;
			light.haze += density * dt;
		}
	}
	return light;
}
#endif
