// The color of pixels that look up at the layer. UP_DISC: some show the sun's disc; FIELD_NEAR: all are near.
#include "shaders/lib/colour.glsl"
#include "shaders/lib/view_up.glsl"

void pass(ivec2 pixel)
{
	vec2 at = vec2(pixel) + 0.5;
#if UP_DISC
	vec3 disc = vec3(sun_at_camera) * sun_disc_share(pixel);
#else
	vec3 disc = vec3(0.0);
#endif
	float shown = camera_shows(at) ? 1.0 : 0.0;
	STORE(0, vec4(shown * colour_of_bands(up_radiance(camera_ray(at), disc)), 1.0));
}
