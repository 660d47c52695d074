// Viewing rays. Pixel coordinates count from the upper left corner; pixel centres lie at halves.
#ifndef SHADERS_LIB_CAMERA
#define SHADERS_LIB_CAMERA
#include "shaders/lib/scene_block.glsl"

vec3 camera_ray(vec2 at)
{
	float x = 2.0 * at.x * image_size.z - 1.0;
	float y = 1.0 - 2.0 * at.y * image_size.w;
	return normalize(vec3(camera_forward) + x * camera_right.w * vec3(camera_right) + y * camera_up.w * vec3(camera_up));
}
#endif
