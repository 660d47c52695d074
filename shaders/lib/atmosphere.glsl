// Clear air: Rayleigh scattering, aerosol and ozone over a spherical Earth.
//
// Rayleigh and aerosol fall off exponentially (8 km, 1.2 km); ozone is a tent between 10 and 40 km. The transmittance table follows Bruneton and Neyret
// 2008, section 4; scattering of second and higher order follows Hillaire 2020 ("A Scalable and Production Ready Sky and Atmosphere Rendering
// Technique", section 5.5): isotropic, and closed as a geometric series.
#ifndef SHADERS_LIB_ATMOSPHERE
#define SHADERS_LIB_ATMOSPHERE
#include "shaders/lib/sphere.glsl"

const float ATMOSPHERE_HEIGHT = 100000.0;
const vec2 TRANSMITTANCE_SIZE = vec2(256.0, 64.0);
const vec2 MULTISCATTER_SIZE = vec2(32.0, 32.0);

float ozone_profile(float h)
{
	return max(0.0, 1.0 - abs(h - ozone.w) / 15000.0);
}

vec3 atmosphere_rayleigh(float h)
{
	return vec3(rayleigh) * exp(-h / rayleigh.w);
}

vec3 atmosphere_aerosol(float h)
{
	return vec3(aerosol) * exp(-h / aerosol.w);
}

vec3 atmosphere_extinction(float h)
{
	return atmosphere_rayleigh(h) + atmosphere_aerosol(h) + vec3(ozone) * ozone_profile(h);
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

// Optical thickness of the air over a distance, by the midpoint rule.
vec3 atmosphere_optical_thickness(float h, float mu, float distance, int steps)
{
	vec3 sum = vec3(0.0);
	float dt = distance / float(steps);
	for (int i = 0; i < steps; i++)
		sum += atmosphere_extinction(max(0.0, sphere_height(h, mu, (float(i) + 0.5) * dt)));
	return sum * dt;
}

// --- multiple scattering ----------------------------------------------------------------------------------------------------

// Coordinates over cosine of the sun's zenith angle (down to twilight, denser at the horizon) and height.
vec2 multiscatter_coordinates(float h, float mu_sun)
{
	float x = 0.5 + 0.5 * sign(mu_sun) * sqrt(abs(mu_sun));
	return vec2(table_coordinate(clamp(x, 0.0, 1.0), MULTISCATTER_SIZE.x),
	            table_coordinate(sqrt(clamp(h / ATMOSPHERE_HEIGHT, 0.0, 1.0)), MULTISCATTER_SIZE.y));
}

// The inverse: x height, y cosine.
vec2 multiscatter_parameters(vec2 coordinates)
{
	float x = 2.0 * table_unit(coordinates.x, MULTISCATTER_SIZE.x) - 1.0;
	float y = table_unit(coordinates.y, MULTISCATTER_SIZE.y);
	return vec2(y * y * ATMOSPHERE_HEIGHT, sign(x) * x * x);
}
#endif
