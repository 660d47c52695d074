// What falls on a horizontal plane at the camera, ray by ray; the sum over all texels is the irradiance, W/m2/nm. Rows from the top: arguments[0].y even ones, .z
// round the sun, each arguments[0].x wide. The sun's disc is left out.
#include "shaders/lib/hemisphere.glsl"
#include "shaders/lib/view.glsl"

void pass(ivec2 pixel)
{
	float row = float(pixel.y);
	bool is_even = row < arguments[0].y;
	float first = is_even ? 0.0 : arguments[0].y;
	float rows = is_even ? arguments[0].y : arguments[0].z;
	float count = rows * arguments[0].x;
	// Rows are turned against each other by the golden ratio, so that no direction is met by all of them.
	vec2 at = vec2(fract((float(pixel.x) + 0.5) / arguments[0].x + 0.61803399 * row), (row - first + 0.5) / rows);
	hemisphere_sample even = hemisphere_even(at, count);
	hemisphere_sample near = hemisphere_near(at, count);
	view_parts parts = view_ray(is_even ? even.direction : near.direction, vec3(0.0));
	STORE(0, vec4((is_even ? even.weight : near.weight) * view_sum(parts), 1.0));
}
