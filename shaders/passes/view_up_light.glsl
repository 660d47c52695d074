// Light of the orders from the second on, and the share of diffuse light, for shaders/lib/view_up.glsl.
#include "shaders/lib/view_up.glsl"

void pass(ivec2 pixel)
{
	int rows = int(UP_LIGHT_SIZE.y);
	vec2 unit = vec2(pixel.x, pixel.y % rows) / (UP_LIGHT_SIZE - 1.0);
	float thickness = up_depth_thickness(float(pixel.y / rows) / (UP_LIGHT_DEPTHS - 1.0));
	STORE(0, vec4(up_light_of(unit, thickness), up_share_of(unit, thickness)));
}
