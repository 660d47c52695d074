// First light on both planes: 0 ground: light received from the cloud base; 1 base: nothing yet;
// 2 what the ground sends up next; 3 what the base sends down next (nothing: its source has been counted).
#include "shaders/lib/radiosity.glsl"

uniform sampler2D cloud_source;
uniform sampler2D ground_albedo_plane;
uniform sampler2D ground_direct;

void pass(ivec2 pixel)
{
	vec2 uv = (vec2(pixel) + 0.5) / 128.0;
	vec3 received = exchange_received(cloud_source, uv);
	vec3 albedo = vec3(texelFetch(ground_albedo_plane, pixel, 0));
	STORE(0, vec4(received, 1.0));
	STORE(1, vec4(0.0, 0.0, 0.0, 1.0));
	STORE(2, vec4(albedo * (received + vec3(texelFetch(ground_direct, pixel, 0))), 1.0));
	STORE(3, vec4(0.0, 0.0, 0.0, 1.0));
}
