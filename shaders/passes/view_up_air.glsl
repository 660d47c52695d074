// The sky's tables for shaders/lib/view_up.glsl: 0 sky behind the layer, 1 what the air before it adds, 2 the sun's irradiance that light of the layer
// brings to the camera; transmittance of the air to the layer, a band each, in the fourth channels.
#include "shaders/lib/scene_block.glsl"

uniform sampler2D sky_total;
uniform sampler2D sky_near;
uniform sampler2D air_to_layer;
uniform sampler2D air_to_end;

void pass(ivec2 pixel)
{
	vec3 near = vec3(texelFetch(sky_near, pixel, 0));
	vec3 to_layer = vec3(texelFetch(air_to_layer, pixel, 0));
	STORE(0, vec4(max(vec3(texelFetch(sky_total, pixel, 0)) - near, vec3(0.0)), to_layer.x));
	STORE(1, vec4(near * vec3(air_below) + (vec3(1.0) - to_layer) * vec3(air_around), to_layer.y));
	STORE(2, vec4(vec3(texelFetch(air_to_end, pixel, 0)), to_layer.z));
}
