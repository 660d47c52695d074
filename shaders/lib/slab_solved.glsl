// The plane-parallel slab as solved for all orders of scattering (renderer/optics/slab.h): radiances for an irradiance of 1 on a plane normal to
// the beam. tau is the scaled optical thickness (1 - f) tau of delta-M per band; thickness is H, m; mu_l and mu_v the cosines of light and
// view to the vertical, both positive.
#ifndef SHADERS_LIB_SLAB_SOLVED
#define SHADERS_LIB_SLAB_SOLVED
#include "shaders/lib/slab.glsl"

#ifndef __cplusplus
uniform sampler3D slab_slices;
#endif

const float SOLVED_DEPTHS = 65.0;
const float SOLVED_AZIMUTHS = 32.0;
const float SOLVED_DEPTH_MIN = 0.01; // optical thickness of the first plane; four planes an octave
const float SOLVED_DEPTH_LAST = 551.0;

// Mean slant depth of light scattered once on its way through, a and b the depths along light and view: the mean of a u + b (1 - u), weighted
// with its own attenuation.
float solved_mean_depth(float a, float b)
{
	float low = min(a, b);
	float d = min(abs(a - b), 60.0);
	return low + (d < 0.05 ? d * (0.5 - d * (1.0 / 12.0)) : 1.0 - d / (exp(d) - 1.0));
}

// The residual tables' columns are dense at both ends: sine of half the angle from either end as a square.
float solved_residual_column(vec2 half_angle)
{
	float x = 0.5 * sqrt(min(half_angle.x, half_angle.y) * 1.41421356);
	return (half_angle.x < half_angle.y ? x : 1.0 - x) * (EVENT_TABLE_SIZE.x - 1.0);
}

// Mean of exp(-(a - 1) t) over slant depths t = 0..s, weighted with exp(-t): what reflected light keeps of what a fuller extinction takes.
vec3 solved_mean_kept(vec3 s, vec3 a)
{
	if (s.y < 0.01)
		return vec3(1.0) - 0.5 * s * (a - vec3(1.0));
	return (vec3(1.0) - exp(-s * a)) / (a * (vec3(1.0) - exp(-s)));
}

// Phase function of the first order of scattering with all that delta-M takes out of the peak put back once: the aureole and the blur of the
// glory. s: slant depth at 550 nm, scaled, of the path in and out (reflected) or the mean one (through); the tables' rows are made for it, with each
// band at the depth that it has then (renderer/stages/droplets.c).
vec3 solved_first_phase(vec2 half_angle, float s, bool through)
{
	vec3 ratio = vec3(extinction) / vec3(extinction_scaled); // 1 / (1 - f)
	vec3 depth = vec3(extinction_scaled) * (s / extinction_scaled.y);
	vec3 sharp = phase_full(half_angle) * ratio;
	if (through)
		sharp *= exp((vec3(1.0) - ratio) * depth);
	else
		sharp *= mix(vec3(1.0), solved_mean_kept(depth, ratio), smoothstep(0.587, 0.854, half_angle.x * half_angle.x));
	return max(sharp + event_at(through ? 3.0 : 2.0, solved_residual_column(half_angle), s / (s + 4.0) * (EVENT_DEPTHS - 1.0)), vec3(0.0));
}

// Radiance of the first order. mu_l and mu_v may be those to a facet.
vec3 solved_first(vec2 half_angle, vec3 tau, float mu_l, float mu_v, bool through)
{
	float a = tau.y / mu_l;
	float b = tau.y / mu_v;
	vec3 shape = through ? slab_single_transmitted(tau, mu_l, mu_v) : slab_single_reflected(tau, mu_l, mu_v);
	return solved_first_phase(half_angle, through ? solved_mean_depth(a, b) : a + b, through) * shape * (0.25 / PI);
}

// Plane of an optical thickness (full extinction, 550 nm): logarithmic, and beyond the last computed one linear in the transmittance, which
// goes like 1/(tau + q), to the infinite one.
float solved_depth_index(float tau)
{
	float q = extinction_scaled.w;
	return clamp(4.0 * log2(max(tau, SOLVED_DEPTH_MIN) / SOLVED_DEPTH_MIN), 0.0, SOLVED_DEPTHS - 2.0) +
	       max(tau - SOLVED_DEPTH_LAST, 0.0) / (max(tau, SOLVED_DEPTH_LAST) + q);
}

// Slices are even in this coordinate of the sun's cosine.
float solved_slice_coordinate(float mu_l)
{
	return sqrt(mu_l) - sqrt(1.0 - mu_l);
}

// Radiance of the orders from the second on. The light inside is that of a layer `smooth_thickness` thick, into which it spreads sideways; how much of
// the way to the eye lies in droplets is for the thickness at this very place to say. cos_azimuth: between the headings of light before and after.
// part: which of the lit sides' tables, from 0.
vec3 solved_multiple(float part, float smooth_thickness, vec3 tau, float mu_l, float mu_v, float view_index, float cos_azimuth)
{
	float per_side = slab_slice_range.z;
	float u = clamp((solved_slice_coordinate(mu_l) - slab_slice_range.x) * slab_slice_range.y, 0.0, per_side - 1.0);
	float low = min(floor(u), per_side - 2.0);
	float planes = slab_slice_range.w;
	// Azimuths are denser in front: pi (t + t^2)/2.
	float azimuth = (sqrt(0.25 + acos(clamp(cos_azimuth, -1.0, 1.0)) * (2.0 / PI)) - 0.5) * (SOLVED_AZIMUTHS - 1.0);
	vec3 at = vec3((azimuth + 0.5) / SOLVED_AZIMUTHS, (view_index + 0.5) / SLAB_VIEWS,
	               (solved_depth_index(extinction.y * smooth_thickness) + SOLVED_DEPTHS * (part * per_side + low) + 0.5) / planes);
	vec3 k = mix(vec3(textureLod(slab_slices, at, 0.0)), vec3(textureLod(slab_slices, at + vec3(0.0, 0.0, SOLVED_DEPTHS / planes), 0.0)), u - low);
	vec3 lit = vec3(1.0) - exp(-vec3(extinction_scaled) * (smooth_thickness / mu_l));
	return k * lit * (vec3(1.0) - exp(-tau / mu_v)) * (mu_l / PI);
}
#endif
