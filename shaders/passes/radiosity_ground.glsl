// The ground as the exchange of light with the cloud base sees it. arguments[0].x: texels a side.
// 0 reflectance; 1 light of the sun's beam through the clouds, W/m2/nm.
#include "shaders/lib/ground.glsl"
#include "shaders/lib/sunlight.glsl"

uniform sampler2D cloud_direct;

void pass(ivec2 pixel)
{
	float texel = cloud_layer.z / arguments[0].x;
	vec2 place = (vec2(pixel) + 0.5) * texel;
	// Where the beam that reaches this place passed the layer, in the clouds' frame.
	vec2 through = place + vec2(sun_direction) * cloud_layer.x / max(sun_direction.z, 0.02) - vec2(cloud_drift.x, cloud_drift.y);
	vec3 sun = sun_irradiance(0.0, sun_direction.z) * max(sun_direction.z, 0.0);
	STORE(0, vec4(ground_reflectance(place, texel), 1.0));
	STORE(1, vec4(vec3(textureLod(cloud_direct, through / cloud_layer.z, 0.0)) * sun, 1.0));
}
