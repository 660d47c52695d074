// The solved slab at given places, so that the look-ups can be held against the solver. Per pixel of `probes`: thickness, m; mu_l; mu_v; azimuth between
// the headings of light before and after, radians. arguments[0].x: 1 for transmitted light, .y: part of the slices.
// 0 first order, 1 orders from the second on, for an irradiance of 1 normal to the beam.
#include "shaders/lib/slab_solved.glsl"

uniform sampler2D probes;

void pass(ivec2 pixel)
{
	vec4 at = texelFetch(probes, pixel, 0);
	bool through = arguments[0].x > 0.5;
	vec2 light = vec2(sqrt(1.0 - at.y * at.y), at.y);
	vec2 view = vec2(sqrt(1.0 - at.z * at.z), at.z);
	vec3 before = vec3(light.x, 0.0, -light.y);
	vec3 after = vec3(view.x * cos(at.w), view.x * sin(at.w), through ? -view.y : view.y);
	vec3 tau = vec3(extinction_scaled) * at.x;
	STORE(0, vec4(solved_first(scattering_half_angle(before, after), tau, at.y, at.z, through), 1.0));
	STORE(1, vec4(solved_multiple(arguments[0].y, at.x, tau, at.y, at.z, slab_view_index(at.z), cos(at.w)), 1.0));
}
