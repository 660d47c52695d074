// A periodic picture with its levels into the packed form of shaders/lib/packed.glsl. arguments[0].x: texels a side.
#include "shaders/lib/packed.glsl"
#include "shaders/lib/scene_block.glsl"

uniform sampler2D picture;

void pass(ivec2 pixel)
{
	int side = int(arguments[0].x);
	int level = packed_level(side, pixel);
	int mask = (side >> level) - 1;
	ivec2 low = (pixel - packed_origin(side, level)) & mask;
	ivec2 high = (low + 1) & mask;
	STORE(0, vec4(texelFetch(picture, low, level).x, texelFetch(picture, ivec2(high.x, low.y), level).x,
	              texelFetch(picture, ivec2(low.x, high.y), level).x, texelFetch(picture, high, level).x));
}
