// Viewing rays. Pixel coordinates count from the upper left corner of the picture; pixel centres lie at halves. What each projection means:
// renderer/camera.h.
#ifndef SHADERS_LIB_CAMERA
#define SHADERS_LIB_CAMERA
#include "shaders/lib/scene_block.glsl"

// Decided when the shader is built. VIEW_PROJECTION (enum projection): 0 perspective, and faces of a cubemap; 1 fisheye; 2 equirectangular.
#ifndef VIEW_PROJECTION
#define VIEW_PROJECTION 0
#endif

// Direction of length 1. Beyond the fisheye's circle that of its rim.
vec3 camera_ray(vec2 at)
{
#if VIEW_PROJECTION == 1
	vec2 p = vec2(1.0 - 2.0 * at.x * image_size.z, 1.0 - 2.0 * at.y * image_size.w);
	float r = length(p);
	float zenith = 0.5 * PI * min(r, 1.0);
	return vec3(p * (sin(zenith) / max(r, 1e-7)), cos(zenith));
#elif VIEW_PROJECTION == 2
	float azimuth = 2.0 * PI * at.x * image_size.z;
	float elevation = PI * (0.5 - at.y * image_size.w);
	return vec3(cos(elevation) * sin(azimuth), cos(elevation) * cos(azimuth), sin(elevation));
#else
	float x = 2.0 * at.x * image_size.z - 1.0;
	float y = 1.0 - 2.0 * (at.y - camera_forward.w) * image_size.w;
	return normalize(vec3(camera_forward) + x * camera_right.w * vec3(camera_right) + y * camera_up.w * vec3(camera_up));
#endif
}

// Side of the square that a pixel covers on a horizontal surface, m: at a distance and a cosine to the vertical. The strip that it really
// covers is longer, by the root of the cosine on both sides; where rows of pixels run along the horizon this keeps detail across. In the
// fisheye they run at any angle, and what is finer than the strip is long would come out as dots.
float camera_footprint(float distance, float cosine)
{
#if VIEW_PROJECTION == 1
	return camera_position.w * distance / cosine;
#else
	return camera_position.w * distance * inversesqrt(cosine);
#endif
}

// Length of the strip of such a footprint, m.
float camera_strip(float footprint, float cosine)
{
	return VIEW_PROJECTION == 1 ? footprint : footprint * inversesqrt(cosine);
}

// Is there a picture at all? Not beyond the fisheye's circle.
bool camera_shows(vec2 at)
{
	return VIEW_PROJECTION != 1 || length(vec2(2.0 * at.x * image_size.z - 1.0, 2.0 * at.y * image_size.w - 1.0)) <= 1.0;
}
#endif
