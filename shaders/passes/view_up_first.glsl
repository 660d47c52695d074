// The first order of scattering for shaders/lib/view_up.glsl.
#include "shaders/lib/view_up.glsl"

void pass(ivec2 pixel)
{
	STORE(0, vec4(up_first_of(vec2(pixel) / (UP_FIRST_SIZE - 1.0)), 1.0));
}
