// The sky from the camera's height, over directions relative to the sun:
// 0 light of the air along the whole ray (to the ground or out of the atmosphere), 1 the part of it before the cloud layer,
// 2 transmittance of the air to the layer (to the ray's end when it meets none); 3 on rays that end on the ground, transmittance to it; on others, irradiance of
// the layer by the sun where they meet it, through the air to the camera.
#include "shaders/lib/scattering.glsl"
#include "shaders/lib/sky_table.glsl"

const int GROUPS_NEAR = 4; // of SCATTERING_SHARE steps
const int GROUPS_FAR = 6;

// Distance to the cloud layer (its base from below, its top from above), negative when the ray does not reach it.
float layer_distance(float h, float mu, float to_ground)
{
	if (cloud_layer.w < 0.5)
		return -1.0;
	if (h < cloud_layer.x)
		return to_ground >= 0.0 ? -1.0 : sphere_distance_up(h, mu, cloud_layer.x);
	return sphere_distance_down(h, mu, cloud_layer.x + 0.5 * cloud_layer.y);
}

void pass(ivec2 pixel)
{
	vec2 parameters = sky_table_parameters(pixel);
	float h = camera_position.z;
	float mu = parameters.x;
	float mu_sun = sun_direction.z;
	float cos_angle = mu * mu_sun + sqrt(max(0.0, 1.0 - mu * mu)) * sqrt(max(0.0, 1.0 - mu_sun * mu_sun)) * parameters.y;

	// Rows below the horizon meet the ground even where rounding says they just miss it.
	bool below = float(pixel.y) >= 0.5 * SKY_TABLE_SIZE.y;
	float to_ground = below ? max(sphere_distance_down(h, min(mu, sphere_horizon(h) - 1e-7), 0.0), 0.0) : -1.0;
	float end = below ? to_ground : sphere_distance_up(h, mu, ATMOSPHERE_HEIGHT);
	float layer = layer_distance(h, mu, to_ground);
	float split = layer >= 0.0 ? min(layer, end) : end;

	airlight light = airlight_start();
	light = scattering_walk(light, h, mu, mu_sun, cos_angle, 0.0, split, split < end ? GROUPS_NEAR : GROUPS_NEAR + GROUPS_FAR);
	airlight near_light = light;
	if (split < end)
		light = scattering_walk(light, h, mu, mu_sun, cos_angle, split, end, GROUPS_FAR);
	vec3 near_transmittance = exp(-near_light.thickness);
	STORE(0, vec4(light.radiance, 1.0));
	STORE(1, vec4(near_light.radiance, 1.0));
	STORE(2, vec4(near_transmittance, 1.0));
	float height = cloud_layer.x + cloud_layer.y;
	float mu_layer = clamp((mu_sun * (EARTH_RADIUS + h) + split * cos_angle) / (EARTH_RADIUS + cloud_layer.x), -1.0, 1.0);
	vec3 sunlight = sun_irradiance(mu_layer > 0.0 ? height : cloud_layer.x, mu_layer) * near_transmittance;
	STORE(3, vec4(below ? exp(-light.thickness) : sunlight, 1.0));
}
