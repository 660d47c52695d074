// The thickness evened out: means over squares, by cubic splines in between. arguments[0].x: size of both pictures; .y: length to even out over, m.
#include "shaders/lib/bicubic.glsl"
#include "shaders/lib/scene_block.glsl"

uniform sampler2D thickness;

void pass(ivec2 pixel)
{
	float side = arguments[0].x;
	// The spline itself is as wide as a box of two texels.
	float lod = max(0.0, log2(arguments[0].y * side / cloud_layer.z) - 1.0);
	float low = floor(lod);
	vec2 uv = (vec2(pixel) + 0.5) / side;
	float mean[2];
	for (int i = 0; i < 2; i++) {
		float level = low + float(i);
		bicubic_samples s = bicubic_at(uv, side * exp2(-level));
		float a = mix(textureLod(thickness, vec2(s.far.x, s.near.y), level).x, textureLod(thickness, s.near, level).x, s.share.x);
		float b = mix(textureLod(thickness, s.far, level).x, textureLod(thickness, vec2(s.near.x, s.far.y), level).x, s.share.x);
		mean[i] = mix(b, a, s.share.y);
	}
	STORE(0, vec4(mix(mean[0], mean[1], lod - low), 0.0, 0.0, 1.0));
}
