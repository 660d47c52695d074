// Phase functions and the light of the forward peak, out of the tables of the optics stage.
#include "shaders/lib/scene_block.glsl"

#ifndef __cplusplus
uniform sampler2D phase_table;
uniform sampler2D forward_peak_table;
uniform sampler2D forward_blur_table;
#endif

const float FORWARD_PEAK_ANGLE = 0.08726646;
const float FORWARD_ANGLE_MAX = 0.6;
const vec2 FORWARD_PEAK_SIZE = vec2(128.0, 32.0);
const vec2 FORWARD_BLUR_SIZE = vec2(256.0, 32.0);
const float PHASE_TABLE_WIDTH = 2048.0;

// Scattering angle 0..pi between two unit vectors: the direction of light before and after. Stable at both ends, where the peaks are.
float scattering_angle(vec3 before, vec3 after)
{
	float s = length(before - after);
	float c = length(before + after);
	return 2.0 * atan(s, c);
}

// The table is uniform in sin(angle/2) in front and in cos(angle/2) behind, so that forward peak and glory are both resolved.
float phase_coordinate(float angle)
{
	float unit = angle < 0.5 * PI ? sin(0.5 * angle) * 0.70710678 : 1.0 - cos(0.5 * angle) * 0.70710678;
	return (0.5 + unit * (PHASE_TABLE_WIDTH - 1.0)) / PHASE_TABLE_WIDTH;
}

// P at an angle, normalised to 4 pi.
vec3 phase_full(float angle)
{
	return exp(vec3(textureLod(phase_table, vec2(phase_coordinate(angle), 0.25), 0.0)));
}

// P_2, the modified phase function convolved with itself.
vec3 phase_twice(float angle)
{
	return exp(vec3(textureLod(phase_table, vec2(phase_coordinate(angle), 0.75), 0.0)));
}

float forward_depth(float s)
{
	float w = s / (s + 4.0);
	return clamp(w, 0.5 / FORWARD_PEAK_SIZE.y, 1.0 - 0.5 / FORWARD_PEAK_SIZE.y);
}

// Radiance per irradiance (1/sr) of light that met forward events alone, two or more, on a path of optical length s (full extinction).
vec3 forward_peak(float angle, float s)
{
	if (angle >= FORWARD_ANGLE_MAX)
		return vec3(0.0);
	float x = (0.5 + sqrt(angle / FORWARD_ANGLE_MAX) * (FORWARD_PEAK_SIZE.x - 1.0)) / FORWARD_PEAK_SIZE.x;
	return vec3(textureLod(forward_peak_table, vec2(x, forward_depth(s)), 0.0));
}

// What forward events of a path of optical length s add to the phase function of its one other event.
vec3 forward_blur(float angle, float s)
{
	float x = (0.5 + angle / PI * (FORWARD_BLUR_SIZE.x - 1.0)) / FORWARD_BLUR_SIZE.x;
	return vec3(textureLod(forward_blur_table, vec2(x, forward_depth(s)), 0.0));
}
