// How high the shadow reaches that the height field throws over itself: over a place the largest of H(place + d) - d tan(elevation) towards the sun. Distances
// double from pass to pass: what reaches twice as far is the higher of two that reach half as far. arguments[0].x: distance to the second, in textures;
// .y: by how much its shadow has sunk on the way, m; .z: 1 for the first pass, made of heights.
#include "shaders/lib/height_sun.glsl"

#ifndef __cplusplus
uniform sampler2D shadow_below;
#endif

void pass(ivec2 pixel)
{
	vec2 here = (vec2(pixel) + 0.5) / HEIGHT_SIZE_LIGHT;
	vec2 there = here + arguments[0].x * height_sun_heading();
	if (arguments[0].z > 0.5) {
		float lod = log2(cloud_puffs.z / HEIGHT_SIZE_LIGHT);
		STORE(0, vec4(textureLod(height_table, there, lod).x * cloud_layer.y - arguments[0].y, 0.0, 0.0, 1.0));
	} else {
		float far = textureLod(shadow_below, there, 0.0).x - arguments[0].y;
		STORE(0, vec4(max(texelFetch(shadow_below, pixel, 0).x, far), 0.0, 0.0, 1.0));
	}
}
