// Clear air: Rayleigh scattering, aerosol and ozone over a spherical Earth.
//
// Rayleigh falls off as the density of the US Standard Atmosphere 1976 does, by two exponentials (9.2 km up to 10 km, 6.5 km above), aerosol by one (1.2 km);
// ozone is a tent between 10 and 40 km. The transmittance table follows Bruneton and Neyret
// 2008, section 4.
#ifndef SHADERS_LIB_ATMOSPHERE
#define SHADERS_LIB_ATMOSPHERE
#include "shaders/lib/sphere.glsl"

const float ATMOSPHERE_HEIGHT = 100000.0;
const vec2 TRANSMITTANCE_SIZE = vec2(256.0, 64.0);

float ozone_profile(float h)
{
	return max(0.0, 1.0 - abs(h - ozone.w) / 15000.0);
}

const float RAYLEIGH_BEND = 10000.0;
const float RAYLEIGH_SCALE_ABOVE = 6500.0;

vec3 atmosphere_rayleigh(float h)
{
	return vec3(rayleigh) * exp(-min(h, RAYLEIGH_BEND) / rayleigh.w - max(h - RAYLEIGH_BEND, 0.0) / RAYLEIGH_SCALE_ABOVE);
}

vec3 atmosphere_aerosol(float h)
{
	return vec3(aerosol) * exp(-h / aerosol.w);
}

vec3 atmosphere_extinction(float h)
{
	return atmosphere_rayleigh(h) + atmosphere_aerosol(h) + vec3(ozone) * ozone_profile(h);
}

// Legendre moment of the aerosol's phase function from the first on: Cornette and Shanks' is Henyey and Greenstein's, of moments g^l, times
// 3/2 (1 + c^2)/(2 + g^2); c^2 P_l by the recurrence of Legendre polynomials. power: g^l.
float aerosol_moment(float l, float g, float power)
{
	float two = 2.0 * l;
	float above = (l + 1.0) * (l + 2.0) / ((two + 1.0) * (two + 3.0));
	float same = (l + 1.0) * (l + 1.0) / ((two + 1.0) * (two + 3.0)) + l * l / ((two + 1.0) * (two - 1.0));
	float below = l * (l - 1.0) / ((two + 1.0) * (two - 1.0));
	return power * (1.0 + same + above * g * g + below / (g * g)) * (1.5 / (2.0 + g * g));
}

// Moments 0 to 3 of what delta-M scaling with four terms leaves of it. The fourth moment, which it takes off each, is the share of the forward peak.
vec4 aerosol_smooth_moments(float g)
{
	float g2 = g * g;
	return vec4(1.0, aerosol_moment(1.0, g, g), aerosol_moment(2.0, g, g2), aerosol_moment(3.0, g, g2 * g)) - aerosol_moment(4.0, g, g2 * g2);
}

const float RAYLEIGH_SECOND_MOMENT = 0.1;

// Extinction that delta-M scaling takes off the aerosol's: what is scattered into the forward peak.
vec3 atmosphere_forward(float h)
{
	return atmosphere_aerosol(h) * (aerosol_shape.x * (1.0 - aerosol_smooth_moments(aerosol_shape.y).x));
}

// Phase functions, integral over the sphere 1. The argument is the cosine of the scattering angle.
float phase_rayleigh(float c)
{
	return 3.0 / (16.0 * PI) * (1.0 + c * c);
}

// Cornette and Shanks 1992.
float phase_aerosol(float c, float g)
{
	float d = 1.0 + g * g - 2.0 * g * c;
	return 3.0 / (8.0 * PI) * (1.0 - g * g) / (2.0 + g * g) * (1.0 + c * c) / (d * sqrt(d));
}

// What delta-M scaling leaves of the aerosol's phase function, of integral 1 - f.
float phase_aerosol_smooth(float c, float g)
{
	vec4 m = aerosol_smooth_moments(g);
	return (m.x + 3.0 * m.y * c + 2.5 * m.z * (3.0 * c * c - 1.0) + 3.5 * m.w * c * (5.0 * c * c - 3.0)) / (4.0 * PI);
}

// The aerosol's phase function in parts that sum to the whole: x the smooth one; y its forward peak with what four terms missed, of integral f; z and w
// that of light scattered twice and three times by it alone, of integral f too, by Legendre moments whose powers fall off.
vec4 phase_aerosol_parts(float c, float g)
{
	float f = 1.0 - aerosol_smooth_moments(g).x;
	float smooth_part = phase_aerosol_smooth(c, g);
	float before = 1.0;
	float legendre = c;
	float power = g;
	float twice = 1.0 + 3.0 * c;
	float thrice = twice;
	for (int l = 2; l < 18; l++) {
		float next = ((2.0 * float(l) - 1.0) * c * legendre - (float(l) - 1.0) * before) / float(l);
		before = legendre;
		legendre = next;
		power *= g;
		float moment = l < 4 ? 1.0 : aerosol_moment(float(l), g, power) / f;
		float square = (2.0 * float(l) + 1.0) * moment * moment;
		twice += square * legendre;
		thrice += square * moment * legendre;
	}
	return vec4(smooth_part, phase_aerosol(c, g) - smooth_part, twice * f / (4.0 * PI), thrice * f / (4.0 * PI));
}

// --- the transmittance table: from a point to the top of the atmosphere, along rays that do not meet the ground ---------------

float table_coordinate(float unit, float size)
{
	return (0.5 + unit * (size - 1.0)) / size;
}

float table_unit(float coordinate, float size)
{
	return clamp((coordinate * size - 0.5) / (size - 1.0), 0.0, 1.0);
}

vec2 transmittance_coordinates(float h, float mu)
{
	float top = sqrt(ATMOSPHERE_HEIGHT * (2.0 * EARTH_RADIUS + ATMOSPHERE_HEIGHT));
	float rho = sqrt(max(h, 0.0) * (2.0 * EARTH_RADIUS + h));
	float d = sphere_distance_up(h, mu, ATMOSPHERE_HEIGHT);
	float d_min = ATMOSPHERE_HEIGHT - h;
	float d_max = rho + top;
	return vec2(table_coordinate(clamp((d - d_min) / (d_max - d_min), 0.0, 1.0), TRANSMITTANCE_SIZE.x),
	            table_coordinate(clamp(rho / top, 0.0, 1.0), TRANSMITTANCE_SIZE.y));
}

// The inverse: x height, y cosine.
vec2 transmittance_parameters(vec2 coordinates)
{
	float top = sqrt(ATMOSPHERE_HEIGHT * (2.0 * EARTH_RADIUS + ATMOSPHERE_HEIGHT));
	float rho = top * table_unit(coordinates.y, TRANSMITTANCE_SIZE.y);
	// sqrt(R^2 + rho^2) - R without cancellation.
	float h = rho * rho / (sqrt(rho * rho + EARTH_RADIUS * EARTH_RADIUS) + EARTH_RADIUS);
	float d_min = ATMOSPHERE_HEIGHT - h;
	float d_max = rho + top;
	float d = d_min + table_unit(coordinates.x, TRANSMITTANCE_SIZE.x) * (d_max - d_min);
	float mu = d <= 0.0 ? 1.0 : (top * top - rho * rho - d * d) / (2.0 * (EARTH_RADIUS + h) * d);
	return vec2(h, clamp(mu, -1.0, 1.0));
}

// Optical thickness of the air over a distance, by the midpoint rule with steps that grow with their number, since air is densest at the start of
// most ways; w: way through aerosol, in metres of its density at the ground.
vec4 atmosphere_optical_thickness(float h, float mu, float distance, int steps)
{
	vec4 sum = vec4(0.0);
	float previous = 0.0;
	for (int i = 1; i <= steps; i++) {
		float unit = float(i) / float(steps);
		float next = distance * unit * unit;
		float height = max(0.0, sphere_height(h, mu, 0.5 * (previous + next)));
		sum += vec4(atmosphere_extinction(height), exp(-height / aerosol.w)) * (next - previous);
		previous = next;
	}
	return sum;
}
#endif
