// A picture out of one that has arguments[0].x rays a side of a pixel. arguments[0].y: 1 where 0 stands for no value, as of distances; .z: 1 where the sun's disc is
// added, whose light was spread over the picture's own pixels so that it weighs what it should wherever it lies in them.
#include "shaders/lib/colour.glsl"
#include "shaders/lib/sun_disc.glsl"

uniform sampler2D fine;

// Solid angle that belongs to a place of the view, over the largest.
float camera_density(vec2 at)
{
#if VIEW_PROJECTION == 1
	float zenith = 0.5 * PI * length(vec2(1.0 - 2.0 * at.x * image_size.z, 1.0 - 2.0 * at.y * image_size.w));
	return sin(zenith) / max(zenith, 1e-6);
#elif VIEW_PROJECTION == 2
	return cos(PI * (0.5 - at.y * image_size.w));
#else
	float along = dot(camera_ray(at), vec3(camera_forward));
	return along * along * along;
#endif
}

void pass(ivec2 pixel)
{
	int side = int(arguments[0].x);
	vec3 sum = vec3(0.0);
	float weights = 0.0;
	for (int y = 0; y < side; y++) {
		for (int x = 0; x < side; x++) {
			ivec2 place = pixel * side + ivec2(x, y);
			vec3 value = vec3(texelFetch(fine, place, 0));
			float weight = camera_density((vec2(place) + 0.5) / arguments[0].x);
			weight = arguments[0].y > 0.5 && value.x == 0.0 ? 0.0 : weight;
			sum += weight * value;
			weights += weight;
		}
	}
	vec3 disc = arguments[0].z * colour_of_bands(vec3(sun_at_camera) * sun_disc_share(pixel));
	STORE(0, vec4(sum / max(weights, 1e-9) + disc, 1.0));
}
