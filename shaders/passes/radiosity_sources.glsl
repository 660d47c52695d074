// What the exchange starts from, per texel of both planes:
// 0 cloud base: diffuse light sent down (sun scattered often, and the sky through the layer), W/m2/nm
// 1 cloud base: albedo for diffuse light; 2 ground: reflectance; 3 ground: direct light of the sun through the clouds, W/m2/nm.
#include "shaders/lib/ground.glsl"
#include "shaders/lib/radiosity.glsl"
#include "shaders/lib/slab.glsl"
#include "shaders/lib/sunlight.glsl"

const int SAMPLES = 3; // a side

void pass(ivec2 pixel)
{
	float texel = cloud_layer.z / 128.0;
	float mu_l = sun_direction.z;
	vec3 sun_at_cloud = sun_irradiance(cloud_layer.x + cloud_layer.y, mu_l) * max(mu_l, 0.0);
	vec3 sun_at_ground = sun_irradiance(0.0, mu_l) * max(mu_l, 0.0);
	// Where the beam that reaches this place passed the layer.
	vec2 parallax = vec2(sun_direction) * cloud_layer.x / max(mu_l, 0.02);

	vec3 source = vec3(0.0);
	vec3 albedo = vec3(0.0);
	vec3 reflectance = vec3(0.0);
	vec3 direct = vec3(0.0);
	for (int y = 0; y < SAMPLES; y++) {
		for (int x = 0; x < SAMPLES; x++) {
			vec2 place = (vec2(pixel) + (vec2(float(x), float(y)) + 0.5) / float(SAMPLES)) * texel;
			float thickness = field_thickness(place, texel / float(SAMPLES));
			float above = field_thickness(place + parallax, texel / float(SAMPLES));
			vec3 back = slab_spherical_albedo(thickness);
			source += slab_multiple(thickness, true) * sun_at_cloud +
			          (vec3(1.0) - back) * vec3(sky_irradiance_cloud);
			albedo += back;
			reflectance += ground_reflectance(place, texel / float(SAMPLES));
			direct += slab_directional_transmittance(above) * sun_at_ground;
		}
	}
	float scale = 1.0 / float(SAMPLES * SAMPLES);
	STORE(0, vec4(source * scale, 1.0));
	STORE(1, vec4(albedo * scale, 1.0));
	STORE(2, vec4(reflectance * scale, 1.0));
	STORE(3, vec4(direct * scale, 1.0));
}
