// What the top receives of the sun. x: times the share of it that is scattered here; y: that share; z: what would be scattered of the beams that end on the
// base below, with all that stands in their way; w: height above which there is no shadow, at least that of the top, m. Means of x, y and z over the tile are fluxes.
#include "shaders/lib/height_sun.glsl"

#ifndef __cplusplus
uniform sampler2D shadow_table;
#endif

void pass(ivec2 pixel)
{
	vec2 at = (vec2(pixel) + 0.5) / HEIGHT_SIZE_LIGHT;
	float texel = cloud_layer.z / HEIGHT_SIZE_LIGHT;
	float height = textureLod(height_table, at, log2(cloud_puffs.z / HEIGHT_SIZE_LIGHT)).x * cloud_layer.y;
	float shade = max(height, texelFetch(shadow_table, pixel, 0).x);
	vec2 slope = height_slope(at * cloud_layer.z + vec2(cloud_drift.x, cloud_drift.y), 0.5 * texel);
	// Thin cloud is lit throughout, whatever the shape of its surface.
	float dense = 1.0 - exp(-extinction_scaled.y * height);
	float received = mix(1.0, height_received(height, slope, shade), dense);
	float caught = height_caught(height);
	STORE(0, vec4(received * caught, caught, height_caught(shade), shade));
}
