// What the layer leaves of the sun's beam on its way to the camera below it, over the disc (struct sun_cover). arguments[0]: a, side; arguments[1]: b.
#define FIELD_WARPED 1
#include "shaders/lib/field.glsl"
#include "shaders/lib/sphere.glsl"

void pass(ivec2 pixel)
{
	vec2 at = 2.0 * (vec2(pixel) + 0.5) / arguments[0].w - 1.0;
	float angle = sun_direction.w * length(at);
	vec3 aside = normalize(at.x * vec3(arguments[0]) + at.y * vec3(arguments[1]));
	vec3 direction = cos(angle) * vec3(sun_direction) + sin(angle) * aside;
	float t = sphere_distance_up(camera_position.z, direction.z, cloud_layer.x);
	float mu = max(sphere_cosine(camera_position.z, direction.z, t, cloud_layer.x), 0.01);
	vec2 place = vec2(camera_position) + vec2(direction) * t;
	float footprint = 2.0 * sun_direction.w / arguments[0].w * t;
	STORE(0, vec4(exp(-vec3(extinction) * (field_thickness(place, footprint) / mu)), 1.0));
}
