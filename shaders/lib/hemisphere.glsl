// Directions over the upper hemisphere for its irradiance: even ones, ever denser ones round the sun, whose aureole is steep.
#ifndef SHADERS_LIB_HEMISPHERE
#define SHADERS_LIB_HEMISPHERE
#include "shaders/lib/scene_block.glsl"

struct hemisphere_sample {
	vec3 direction;
	float weight; // solid angle times the cosine to the vertical times the share below; 0 under the horizon
};

// Even directions hand over to those round the sun between these angles.
const float HEMISPHERE_NEAR_INNER = 8.0 * PI / 180.0;
const float HEMISPHERE_NEAR_OUTER = 16.0 * PI / 180.0;

// Share of a direction's light that the samples round the sun count. angle: to the sun.
float hemisphere_near_share(float angle)
{
	return 1.0 - smoothstep(HEMISPHERE_NEAR_INNER, HEMISPHERE_NEAR_OUTER, angle);
}

// at: 0..1 in azimuth and in the sine squared of the zenith angle, both of which are even in irradiance; count: of samples.
hemisphere_sample hemisphere_even(vec2 at, float count)
{
	float azimuth = 2.0 * PI * at.x;
	float sine = sqrt(at.y);
	hemisphere_sample s;
	s.direction = vec3(sine * sin(azimuth), sine * cos(azimuth), sqrt(1.0 - at.y));
	float chord = min(0.5 * length(s.direction - vec3(sun_direction)), 1.0);
	s.weight = PI / count * (1.0 - hemisphere_near_share(2.0 * asin(chord)));
	return s;
}

// A direction at an angle from the sun, at a position angle round it.
vec3 hemisphere_from_sun(float angle, float around)
{
	vec3 sun = vec3(sun_direction);
	vec3 side = abs(sun.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0);
	vec3 right = normalize(cross(side, sun));
	vec3 up = cross(sun, right);
	return normalize(cos(angle) * sun + sin(angle) * (cos(around) * right + sin(around) * up));
}

// at: 0..1 round the sun and in the square root of the angle from it.
hemisphere_sample hemisphere_near(vec2 at, float count)
{
	float angle = HEMISPHERE_NEAR_OUTER * at.y * at.y;
	hemisphere_sample s;
	s.direction = hemisphere_from_sun(angle, 2.0 * PI * at.x);
	s.weight = 4.0 * PI * HEMISPHERE_NEAR_OUTER * at.y * sin(angle) / count * hemisphere_near_share(angle) * max(s.direction.z, 0.0);
	return s;
}
#endif
