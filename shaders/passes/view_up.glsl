// The color of pixels that look up at the layer.
#include "shaders/lib/colour.glsl"
#include "shaders/lib/view_up.glsl"

void pass(ivec2 pixel)
{
	STORE(0, vec4(colour_of_bands(up_radiance(camera_ray(vec2(pixel) + 0.5))), 1.0));
}
