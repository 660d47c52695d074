// Diffuse light in the air: all that was scattered or reflected before it reaches a point, and what a point scatters of it. It is tabulated over height and
// sun for unit solar irradiance by its spherical harmonics up to the third degree, which is all that phase functions of four Legendre terms ask for:
// Rayleigh's is one, and the aerosol's becomes one by delta-M scaling (Wiscombe 1977), which counts its forward peak as not scattered.
//
// Directions are those one looks along, in a local frame: z up, x horizontal towards the sun, y beside it, about which everything is symmetric. The
// harmonics are 1; z, x; (3 z^2 - 1)/2, x z, x^2 - y^2; z (5 z^2 - 3)/2, x (5 z^2 - 1), z (x^2 - y^2), x (x^2 - 3 y^2). Tables hold the logarithm of the mean
// radiance over the sphere, since twilight spans many powers of ten, and the means of radiance times the others over it: the first eight as colours,
// the bands of the last two in the fourth components.
#ifndef SHADERS_LIB_MULTISCATTER
#define SHADERS_LIB_MULTISCATTER
#include "shaders/lib/sunlight.glsl"

#ifndef __cplusplus
uniform sampler2D diffuse_0;
uniform sampler2D diffuse_1;
uniform sampler2D diffuse_2;
uniform sampler2D diffuse_3;
uniform sampler2D diffuse_4;
uniform sampler2D diffuse_5;
uniform sampler2D diffuse_6;
uniform sampler2D diffuse_7;
#endif

const vec2 MULTISCATTER_SIZE = vec2(40.0, 16.0);
const float MULTISCATTER_HEIGHT = 60000.0;
const float MULTISCATTER_LOWEST = 0.35; // sine of the deepest sun; there it is night
const float MULTISCATTER_ZERO = 0.4;    // share of the columns with the sun below the horizontal
const float MULTISCATTER_DARK = 1e-24;

// Coordinates over cosine of the sun's zenith angle (denser at the horizon) and height (denser at the ground).
vec2 multiscatter_coordinates(float h, float mu_sun)
{
	float below = MULTISCATTER_ZERO * (1.0 - sqrt(clamp(-mu_sun / MULTISCATTER_LOWEST, 0.0, 1.0)));
	float above = MULTISCATTER_ZERO + (1.0 - MULTISCATTER_ZERO) * sqrt(clamp(mu_sun, 0.0, 1.0));
	return vec2(table_coordinate(mu_sun < 0.0 ? below : above, MULTISCATTER_SIZE.x),
	            table_coordinate(sqrt(clamp(h / MULTISCATTER_HEIGHT, 0.0, 1.0)), MULTISCATTER_SIZE.y));
}

// The inverse: x height, y cosine.
vec2 multiscatter_parameters(vec2 coordinates)
{
	float x = table_unit(coordinates.x, MULTISCATTER_SIZE.x);
	float y = table_unit(coordinates.y, MULTISCATTER_SIZE.y);
	float below = 1.0 - x / MULTISCATTER_ZERO;
	float above = (x - MULTISCATTER_ZERO) / (1.0 - MULTISCATTER_ZERO);
	return vec2(y * y * MULTISCATTER_HEIGHT, x < MULTISCATTER_ZERO ? -MULTISCATTER_LOWEST * below * below : above * above);
}

// The part of a direction towards the sun's azimuth: mu its cosine to the vertical, cos_angle to the sun.
float multiscatter_ahead(float mu, float mu_sun, float cos_angle)
{
	float ahead = (cos_angle - mu * mu_sun) * inversesqrt(max(1.0 - mu_sun * mu_sun, 1e-6));
	float most = sqrt(max(0.0, 1.0 - mu * mu));
	return clamp(ahead, -most, most);
}

struct diffuse_radiance {
	vec3 rayleigh; // over the sphere by Rayleigh's phase function
	vec3 aerosol;  // by the aerosol's, without its forward peak
};

// The harmonics of one degree in a direction of components up and ahead; y2: the square of the third.
vec3 harmonics_second(float up, float ahead, float y2)
{
	return vec3(1.5 * up * up - 0.5, ahead * up, ahead * ahead - y2);
}

vec4 harmonics_third(float up, float ahead, float y2)
{
	return vec4(up * (2.5 * up * up - 1.5), ahead * (5.0 * up * up - 1.0), up * (ahead * ahead - y2), ahead * (ahead * ahead - 3.0 * y2));
}

// Their weights in the addition theorem, P_l(cos) = sum of weight x harmonic x harmonic.
const vec3 HARMONICS_SECOND = vec3(1.0, 3.0, 0.75);
const vec4 HARMONICS_THIRD = vec4(1.0, 0.375, 3.75, 0.625);

// Diffuse light at a point as it is seen scattered, over the scattering coefficients: in a direction of components `up` and `ahead`.
diffuse_radiance multiscatter_seen(float h, float mu_sun, float up, float ahead)
{
	vec2 at = multiscatter_coordinates(h, mu_sun);
	vec4 moment_0 = textureLod(diffuse_0, at, 0.0);
	vec4 moment_1 = textureLod(diffuse_1, at, 0.0);
	vec4 moment_2 = textureLod(diffuse_2, at, 0.0);
	vec4 moment_3 = textureLod(diffuse_3, at, 0.0);
	vec4 moment_4 = textureLod(diffuse_4, at, 0.0);
	vec4 moment_5 = textureLod(diffuse_5, at, 0.0);
	float beside = max(0.0, 1.0 - up * up - ahead * ahead);
	vec3 second = HARMONICS_SECOND * harmonics_second(up, ahead, beside);
	vec4 third = HARMONICS_THIRD * harmonics_third(up, ahead, beside);
	vec3 mean = exp(vec3(moment_0));
	vec3 degree_1 = up * vec3(moment_1) + ahead * vec3(moment_2);
	vec3 degree_2 = second.x * vec3(moment_3) + second.y * vec3(moment_4) + second.z * vec3(moment_5);
	vec3 degree_3 = third.x * vec3(textureLod(diffuse_6, at, 0.0)) + third.y * vec3(textureLod(diffuse_7, at, 0.0)) +
	                third.z * vec3(moment_0.w, moment_1.w, moment_2.w) + third.w * vec3(moment_3.w, moment_4.w, moment_5.w);
	vec4 shape = aerosol_smooth_moments(aerosol_shape.y);
	diffuse_radiance seen;
	seen.rayleigh = mean * (vec3(1.0) + 5.0 * RAYLEIGH_SECOND_MOMENT * degree_2);
	seen.aerosol = mean * max(vec3(shape.x) + 3.0 * shape.y * degree_1 + 5.0 * shape.z * degree_2 + 7.0 * shape.w * degree_3, vec3(0.0));
	return seen;
}
#endif
