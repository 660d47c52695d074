// The cloud base as the exchange of light with the ground sees it, in the frame of the drifting clouds; per texel the mean over the thicknesses beneath it.
// arguments[0].x: texels of the thickness map a side of a texel; less than 1 where those are larger.
// 0 diffuse light sent down (sun scattered often, the sky through the layer, and what the air below adds), W/m2/nm
// 1 albedo for diffuse light; 2 transmittance for the beam.
#include "shaders/lib/slab.glsl"
#include "shaders/lib/sunlight.glsl"

uniform sampler2D thickness_table;

void pass(ivec2 pixel)
{
	int side = int(max(arguments[0].x, 1.0));
	ivec2 first = ivec2(vec2(pixel) * arguments[0].x);
	vec3 diffuse = vec3(0.0);
	vec3 albedo = vec3(0.0);
	vec3 direct = vec3(0.0);
	for (int y = 0; y < side; y++) {
		for (int x = 0; x < side; x++) {
			float thickness = texelFetch(thickness_table, first + ivec2(x, y), 0).x;
			diffuse += slab_multiple(thickness, true);
			albedo += slab_spherical_albedo(thickness);
			direct += slab_directional_transmittance(thickness);
		}
	}
	float share = 1.0 / float(side * side);
	float mu_l = max(sun_direction.z, 0.0);
	vec3 sun = sun_irradiance(cloud_layer.x + cloud_layer.y, sun_direction.z) * mu_l;
	vec3 sky = vec3(sky_irradiance_cloud);
	// What the air below adds to a clear sky's light, or takes of it: where no cloud is, the ground has its clear sky.
	vec3 air = vec3(sky_irradiance_ground) - sky;
	STORE(0, vec4(max(share * (diffuse * sun + direct * air) + (vec3(1.0) - share * albedo) * sky, vec3(0.0)), 1.0));
	STORE(1, vec4(share * albedo, 1.0));
	STORE(2, vec4(share * direct, 1.0));
}
