// Counts how often each density occurs, with detail and interpolation as they are seen later, so that coverage means coverage.
#include "shaders/lib/field.glsl"

layout(std430, binding = 0) buffer histogram { uint count[]; };

void pass(ivec2 pixel)
{
	// Off the texels' centres, where interpolated values vary less than anywhere else; arguments[0].w: places a side.
	vec2 place = (vec2(pixel) + vec2(0.31, 0.73)) * cloud_layer.z / arguments[0].w + vec2(cloud_drift.x, cloud_drift.y);
	float density = field_density(place, 1.0);
	float unit = (density - arguments[0].x) / (arguments[0].y - arguments[0].x);
	// Shared out between the two nearest bins, so that quantiles move as smoothly as the densities do.
	float bin = clamp(unit, 0.0, 1.0) * (arguments[0].z - 2.0);
	uint share = uint((bin - floor(bin)) * 1024.0 + 0.5);
	atomicAdd(count[int(bin)], 1024u - share);
	atomicAdd(count[int(bin) + 1], share);
}
