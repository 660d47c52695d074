// One exchange: what each plane sends is received by the other, added up, and what it reflects of it is sent next.
// 0 ground received, 1 base received, 2 ground sends, 3 base sends.
#include "shaders/lib/radiosity.glsl"

uniform sampler2D ground_received;
uniform sampler2D cloud_received;
uniform sampler2D ground_sends;
uniform sampler2D cloud_sends;
uniform sampler2D ground_albedo_plane;
uniform sampler2D cloud_albedo_plane;

void pass(ivec2 pixel)
{
	vec2 uv = (vec2(pixel) + 0.5) / 128.0;
	vec3 at_ground = exchange_received(cloud_sends, uv);
	vec3 at_cloud = exchange_received(ground_sends, uv);
	STORE(0, vec4(vec3(texelFetch(ground_received, pixel, 0)) + at_ground, 1.0));
	STORE(1, vec4(vec3(texelFetch(cloud_received, pixel, 0)) + at_cloud, 1.0));
	STORE(2, vec4(vec3(texelFetch(ground_albedo_plane, pixel, 0)) * at_ground, 1.0));
	STORE(3, vec4(vec3(texelFetch(cloud_albedo_plane, pixel, 0)) * at_cloud, 1.0));
}
