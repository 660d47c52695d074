// Height of the cloud top above the base as a picture over the tile, for views from above. arguments[0].x: size.
#include "shaders/lib/field.glsl"

void pass(ivec2 pixel)
{
	float texel = cloud_layer.z / arguments[0].x;
	// The drift is left out here and put back where the table is read, so that its texels stay those of the field.
	vec2 place = (vec2(pixel) + 0.5) * texel + vec2(cloud_drift.x, cloud_drift.y);
	// Fine detail of the density would stand on a thick layer as needles.
	float finest = max(0.5 * texel, 0.1 * cloud_layer.y);
	STORE(0, vec4(field_thickness(place, finest), 0.0, 0.0, 1.0));
}
