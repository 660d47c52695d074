// Shares of diffuse light for shaders/lib/view_up.glsl.
#include "shaders/lib/view_up.glsl"

void pass(ivec2 pixel)
{
	vec2 unit = vec2(pixel) / (UP_SHARE_SIZE - 1.0);
	STORE(0, vec4(up_share_of(unit.y, up_depth_thickness(unit.x)), 1.0));
}
