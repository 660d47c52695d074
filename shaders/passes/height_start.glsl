// Distance, m, up to which no ray of a block of pixels meets the height field. arguments[0].x: pixels a side; .y: those of the larger blocks that have been begun
// before, or 0; .z: row of the picture at which the first ones begin.
#include "shaders/lib/camera.glsl"
#include "shaders/lib/height_march.glsl"

#ifndef __cplusplus
uniform sampler2D height_start;
#endif

// Sine of the angle between a block's rays above which they have too little in common, as where two faces of a cube meet.
const float HEIGHT_BLOCK_WIDEST = 0.1;

void pass(ivec2 pixel)
{
	float side = arguments[0].x;
	vec2 corner = vec2(pixel) * side + vec2(0.0, arguments[0].z);
	vec3 direction = camera_ray(corner + 0.5 * side);
	float radius = 0.0;
	for (int i = 0; i < 4; i++) {
		vec2 at = corner + vec2(float(i / 2), float(i - i / 2 * 2)) * (side - 1.0) + 0.5;
		radius = max(radius, length(camera_ray(at) - direction));
	}
	radius += 0.5 * camera_position.w;
	vec2 range = height_range(direction);
	bool together = radius < HEIGHT_BLOCK_WIDEST && range.x < range.y;
	float begun = arguments[0].y > 0.0 ? texelFetch(height_start, pixel * int(side) / int(arguments[0].y), 0).x : 0.0;
	STORE(0, vec4(together ? height_block_start(direction, range, radius, begun) : begun, 0.0, 0.0, 1.0));
}
