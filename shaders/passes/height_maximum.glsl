// One level of the pyramid of maxima: the largest of the four texels below. arguments[0].x: size of the level below; the first level
// (arguments[0].y = 1) takes the neighbours in, since a ray between texel centres sees them interpolated.
#ifndef __cplusplus
uniform sampler2D height_below;
#endif
#include "shaders/lib/scene_block.glsl"

void pass(ivec2 pixel)
{
	int size = int(arguments[0].x);
	int reach = arguments[0].y > 0.5 ? 1 : 0;
	float highest = 0.0;
	for (int y = -reach; y < 2 + reach; y++)
		for (int x = -reach; x < 2 + reach; x++) {
			ivec2 at = (pixel * 2 + ivec2(x, y) + size) % size;
			highest = max(highest, texelFetch(height_below, at, 0).x);
		}
	STORE(0, vec4(highest, 0.0, 0.0, 1.0));
}
