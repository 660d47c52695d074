// Phase functions and the light of the forward peak, out of the tables of the optics stage.
#ifndef SHADERS_LIB_OPTICS
#define SHADERS_LIB_OPTICS
#include "shaders/lib/scene_block.glsl"

#ifndef __cplusplus
uniform sampler2D phase_table;
uniform sampler2D event_table;
#endif

const float FORWARD_PEAK_SINE = 0.04361939; // of half the peak's 5 degrees
const float FORWARD_PEAK_REACH = 0.6;
// The event table holds four tables over angle and depth on each other, EVENT_DEPTHS rows each: forward peak, forward blur, and the
// residuals of reflection and transmission (shaders/lib/slab_solved.glsl).
const vec2 EVENT_TABLE_SIZE = vec2(512.0, 128.0);
const float EVENT_DEPTHS = 32.0;
const float FORWARD_PEAK_WIDTH = 128.0;
const float FORWARD_BLUR_WIDTH = 256.0;
const float PHASE_TABLE_WIDTH = 2048.0;

// Sine and cosine of half the scattering angle between two unit vectors, the direction of light before and after: exact at both ends, where the
// peaks are, and all that the tables need.
vec2 scattering_half_angle(vec3 before, vec3 after)
{
	return vec2(0.5 * length(before - after), 0.5 * length(before + after));
}

// The tables are uniform in sin(angle/2) in front and in cos(angle/2) behind, so that forward peak and glory are both resolved.
float phase_unit(vec2 half_angle)
{
	return half_angle.x < half_angle.y ? half_angle.x * 0.70710678 : 1.0 - half_angle.y * 0.70710678;
}

// P at an angle, normalised to 4 pi.
vec3 phase_full(vec2 half_angle)
{
	float x = (0.5 + phase_unit(half_angle) * (PHASE_TABLE_WIDTH - 1.0)) / PHASE_TABLE_WIDTH;
	return exp2(vec3(textureLod(phase_table, vec2(x, 0.25), 0.0)));
}

// P_2, the modified phase function convolved with itself.
vec3 phase_twice(vec2 half_angle)
{
	float x = (0.5 + phase_unit(half_angle) * (PHASE_TABLE_WIDTH - 1.0)) / PHASE_TABLE_WIDTH;
	return exp2(vec3(textureLod(phase_table, vec2(x, 0.75), 0.0)));
}

// Texel centre `column` of table `part`, at row 0..EVENT_DEPTHS-1.
vec3 event_at(float part, float column, float row)
{
	return vec3(textureLod(event_table, (vec2(column, part * EVENT_DEPTHS + row) + 0.5) / EVENT_TABLE_SIZE, 0.0));
}

// The tables' first depth; in thinner layers the peak goes with the square of the depth and the blur with the depth.
const float FORWARD_DEPTH_MIN = 0.06349206;

float forward_row(float s)
{
	return clamp(s / (s + 4.0) * EVENT_DEPTHS - 0.5, 0.0, EVENT_DEPTHS - 1.0);
}

// Radiance per irradiance (1/sr) of light that met forward events alone, two or more, on a path of optical length s (full extinction).
vec3 forward_peak(vec2 half_angle, float s)
{
	// 2 arcsin to fourth order, good to 1e-4 over the table's 0.6 rad.
	float angle = 2.0 * half_angle.x * (1.0 + half_angle.x * half_angle.x * (1.0 / 6.0));
	float unit = sqrt(min(angle / FORWARD_PEAK_REACH, 1.0));
	vec3 peak = event_at(0.0, unit * (FORWARD_PEAK_WIDTH - 1.0), forward_row(s));
	float thin = min(s / FORWARD_DEPTH_MIN, 1.0);
	return unit < 1.0 && half_angle.x < half_angle.y ? peak * (thin * thin) : vec3(0.0);
}

// What forward events of a path of optical length s add to the phase function of its one other event.
vec3 forward_blur(vec2 half_angle, float s)
{
	return event_at(1.0, phase_unit(half_angle) * (FORWARD_BLUR_WIDTH - 1.0), forward_row(s)) * min(s / FORWARD_DEPTH_MIN, 1.0);
}
#endif
