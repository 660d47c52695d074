// A picture out of one that has arguments[0].x rays a side of a pixel. arguments[0].y: 1 where 0 stands for no value, as of distances; .z: 1 where the sun's disc is
// added, whose light was spread over the picture's own pixels so that it weighs what it should wherever it lies in them.
#include "shaders/lib/colour.glsl"
#include "shaders/lib/sun_disc.glsl"

uniform sampler2D fine;

// Solid angle that belongs to a place of the view, over the largest; 0 where there is no picture.
float camera_density(vec2 at)
{
#if VIEW_PROJECTION == 1
	float zenith = 0.5 * PI * length(vec2(1.0 - 2.0 * at.x * image_size.z, 1.0 - 2.0 * at.y * image_size.w));
	return camera_shows(at) ? sin(zenith) / max(zenith, 1e-6) : 0.0;
#elif VIEW_PROJECTION == 2
	return cos(PI * (0.5 - at.y * image_size.w));
#else
	vec2 slope = (2.0 * at * vec2(image_size.z, image_size.w) - 1.0) * vec2(camera_right.w, camera_up.w);
	return pow(1.0 + dot(slope, slope), -1.5);
#endif
}

void pass(ivec2 pixel)
{
	int side = int(arguments[0].x);
	ivec2 first = ivec2(0, int(camera_forward.w)); // of the view
	vec3 sum = vec3(0.0);
	float weights = 0.0;
	for (int y = 0; y < side; y++) {
		for (int x = 0; x < side; x++) {
			ivec2 place = pixel * side + ivec2(x, y);
			vec3 value = vec3(texelFetch(fine, place, 0));
			float weight = camera_density((vec2(place - side * first) + 0.5) / arguments[0].x);
			weight = arguments[0].y > 0.5 && value.x == 0.0 ? 0.0 : weight;
			sum += weight * value;
			weights += weight;
		}
	}
	vec3 disc = arguments[0].z * colour_of_bands(vec3(sun_at_camera) * sun_disc_share(pixel));
	float shown = camera_shows(vec2(pixel) + 0.5) ? 1.0 : 0.0;
	STORE(0, vec4(shown * (sum / max(weights, 1e-9) + disc), 1.0));
}
