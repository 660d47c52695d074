// What falls on a horizontal plane at the camera, ray by ray; the sum over all texels is the irradiance, W/m2/nm. Rows from the top: arguments[0].y even ones, .z
// round the sun, .w on its disc (the beam, attenuated by the layer), each arguments[0].x wide.
#include "shaders/lib/hemisphere.glsl"
#include "shaders/lib/view.glsl"

// The beam through the layer along a ray to the disc.
vec3 illuminance_beam(vec3 direction, view_parts parts)
{
#if VIEW_CLOUDS && !VIEW_ABOVE
	float base = cloud_layer.x;
	float t = sphere_distance_up(camera_position.z, direction.z, base);
	float cos_view = max(sphere_cosine(camera_position.z, direction.z, t, base), 0.01);
	return vec3(sun_at_camera) * exp(-vec3(extinction) / extinction.y * (parts.optical_thickness / cos_view));
#else
	return vec3(sun_at_camera);
#endif
}

void pass(ivec2 pixel)
{
	float row = float(pixel.y);
	bool is_even = row < arguments[0].y;
	bool is_near = !is_even && row < arguments[0].y + arguments[0].z;
	float first = is_even ? 0.0 : is_near ? arguments[0].y : arguments[0].y + arguments[0].z;
	float rows = is_even ? arguments[0].y : is_near ? arguments[0].z : arguments[0].w;
	float count = rows * arguments[0].x;
	// Rows are turned against each other by the golden ratio, so that no direction is met by all of them.
	vec2 at = vec2(fract((float(pixel.x) + 0.5) / arguments[0].x + 0.61803399 * row), (row - first + 0.5) / rows);
	hemisphere_sample even = hemisphere_even(at, count);
	hemisphere_sample near = hemisphere_near(at, count);
	hemisphere_sample disc = hemisphere_disc(at, rows);
	vec3 direction = is_even ? even.direction : is_near ? near.direction : disc.direction;

	view_parts parts = view_ray(direction, vec3(0.0));
	vec3 diffuse = (is_even ? even.weight : near.weight) * view_sum(parts);
	vec3 direct = disc.weight / count * max(sun_direction.z, 0.0) * illuminance_beam(direction, parts);
	STORE(0, vec4(is_even || is_near ? diffuse : direct, 1.0));
}
