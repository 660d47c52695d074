// The unscattered disc of the sun as the pixels see it.
#ifndef SHADERS_LIB_SUN_DISC
#define SHADERS_LIB_SUN_DISC
#include "shaders/lib/camera.glsl"

// Decided when the shader is built. 1: the disc is so large that each pixel is taken by itself; 0: its light was spread over the pixels
// beforehand (renderer/sun_disc.h).
#ifndef VIEW_LARGE_SUN
#define VIEW_LARGE_SUN 0
#endif

#if !VIEW_LARGE_SUN && !defined(__cplusplus)
layout(std430, binding = 1) readonly buffer sun_disc_buffer { float sun_disc_weights[]; };
#endif

// Share of the sun's direct irradiance per solid angle that a pixel holds, 1/sr, per band. Of a large disc before a cloud layer; else behind it, as it lies
// before the disc itself, which a coarse pixel hardly sees.
vec3 sun_disc_share(ivec2 pixel)
{
#if VIEW_LARGE_SUN
	// Limb darkened by 1 - u (1 - cos), u = 0.6 in the visible (Allen 1973), whose mean over the disc is 1 - u/3. The edge is as soft as the
	// pixel is long across it.
	vec2 at = vec2(pixel) + 0.5;
	vec3 offset = camera_ray(at) - vec3(sun_direction);
	float angle = length(offset);
	float radius = sun_direction.w;
	vec3 outward = offset / max(angle, 1e-9);
	float across = abs(dot(camera_ray(at + vec2(0.5, 0.0)) - camera_ray(at - vec2(0.5, 0.0)), outward)) +
	               abs(dot(camera_ray(at + vec2(0.0, 0.5)) - camera_ray(at - vec2(0.0, 0.5)), outward));
	float cover = clamp(0.5 + (radius - angle) / max(across, 1e-9), 0.0, 1.0);
	float rho = min(angle / radius, 1.0);
	float limb = (1.0 - 0.6 * (1.0 - sqrt(1.0 - rho * rho))) / 0.8;
	return vec3(sun_disc_box.x * cover * limb / (PI * radius * radius));
#else
	// The box may reach over the right edge of the picture.
	int column = pixel.x - int(sun_disc_box.x);
	int row = pixel.y - int(sun_disc_box.y);
	column += column < 0 ? int(image_size.x) : 0;
	vec3 share = vec3(0.0);
	if (row >= 0 && column < int(sun_disc_box.z) && row < int(sun_disc_box.w)) {
		int first = 3 * (row * int(sun_disc_box.z) + column);
		share = vec3(sun_disc_weights[first], sun_disc_weights[first + 1], sun_disc_weights[first + 2]);
	}
	return share;
#endif
}
#endif
