// One level of the height field's pyramid: means, and maxima over a texel and its neighbours, so that a value interpolated between texels is above all that
// lies half a texel around. arguments[0].x: size of the level below; .y: 1 for the first level, made of heights alone.
#ifndef __cplusplus
uniform sampler2D height_below;
#endif
#include "shaders/lib/scene_block.glsl"

vec2 texel_below(ivec2 at)
{
	int last = int(arguments[0].x) - 1; // a power of two less one
	return vec2(texelFetch(height_below, ivec2(at.x & last, at.y & last), 0));
}

void pass(ivec2 pixel)
{
	bool first = arguments[0].y > 0.5;
	ivec2 corner = first ? pixel : 2 * pixel;
	int last = first ? 1 : 2;
	float highest = 0.0;
	float sum = 0.0;
	for (int y = -1; y <= last; y++)
		for (int x = -1; x <= last; x++) {
			vec2 below = texel_below(corner + ivec2(x, y));
			highest = max(highest, first ? below.x : below.y);
			if (min(x, y) >= 0 && max(x, y) < last)
				sum += below.x;
		}
	// Stored in steps of 1/65535 of the highest: maxima rounded up.
	float unit = first ? 1.0 / max(cloud_layer.y, 1e-3) : 1.0;
	STORE(0, vec4(first ? sum * unit : 0.25 * sum, min(highest * unit + 1.0 / 65535.0, 1.0), 0.0, 1.0));
}
