// Heights below rounded tops. arguments[0].x: points a side of these; .y: of the rounded ones; .z: height over which one runs into the other, m.
#include "shaders/lib/bicubic.glsl"
#include "shaders/lib/scene_block.glsl"

uniform sampler2D heights;
uniform sampler2D rounded;

void pass(ivec2 pixel)
{
	float height = texelFetch(heights, pixel, 0).x;
	float bound = bicubic_sample(rounded, (vec2(pixel) + 0.5) / arguments[0].x, arguments[0].y).x + 0.5 * arguments[0].z;
	// The lower of the two, without an edge.
	float x = max(arguments[0].z - abs(height - bound), 0.0);
	STORE(0, vec4(max(min(height, bound) - x * x / (4.0 * arguments[0].z), 0.0), 0.0, 0.0, 1.0));
}
