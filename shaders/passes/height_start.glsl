// Distance, m, up to which no ray of a block of pixels meets the height field.
#include "shaders/lib/camera.glsl"
#include "shaders/lib/height_march.glsl"

void pass(ivec2 pixel)
{
	vec3 direction = camera_ray((vec2(pixel) + 0.5) * float(HEIGHT_BLOCK));
	// To the corners, and a pixel more.
	float radius = (0.70711 * float(HEIGHT_BLOCK) + 1.0) * camera_position.w;
	vec2 range = height_range(direction);
	STORE(0, vec4(range.x > range.y ? range.x : height_block_start(direction, range, radius), 0.0, 0.0, 1.0));
}
