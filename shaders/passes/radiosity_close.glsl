// What is left after the last exchange is nearly uniform: its further bounces as a geometric series in the means of both planes,
// G = c + a_C g + a_C a_G G ..., with g and c what ground and base would send next. 0 ground received, 1 base received.
#include "shaders/lib/scene_block.glsl"

uniform sampler2D ground_received;
uniform sampler2D cloud_received;
uniform sampler2D ground_sends;
uniform sampler2D cloud_sends;
uniform sampler2D ground_albedo_plane;
uniform sampler2D cloud_albedo_plane;

void pass(ivec2 pixel)
{
	const int TOP = 7; // the level of 1 x 1
	vec3 g = vec3(texelFetch(ground_sends, ivec2(0), TOP));
	vec3 c = vec3(texelFetch(cloud_sends, ivec2(0), TOP));
	vec3 a_g = vec3(texelFetch(ground_albedo_plane, ivec2(0), TOP));
	vec3 a_c = vec3(texelFetch(cloud_albedo_plane, ivec2(0), TOP));
	vec3 series = vec3(1.0) / (vec3(1.0) - min(a_g * a_c, vec3(0.999)));
	STORE(0, vec4(vec3(texelFetch(ground_received, pixel, 0)) + (c + a_c * g) * series, 1.0));
	STORE(1, vec4(vec3(texelFetch(cloud_received, pixel, 0)) + (g + a_g * c) * series, 1.0));
}
