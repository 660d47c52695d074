// Height of the cloud top above the base as a picture over the tile, for views from above. arguments[0].x: size.
#include "shaders/lib/field.glsl"

void pass(ivec2 pixel)
{
	float texel = cloud_layer.z / arguments[0].x;
	// The drift is left out here and put back where the table is read, so that its texels stay those of the field.
	vec2 p = (vec2(pixel) + 0.5) * texel;
	// Fine detail of the density would stand on a thick layer as needles: billows whose height is in proportion to their width take its place.
	float finest = max(0.5 * texel, 0.1 * cloud_layer.y);
	float height = field_thickness(p + vec2(cloud_drift.x, cloud_drift.y), finest);
	float density = textureLod(field_coarse, p / cloud_layer.z, 0.0).x;
	float lump = textureLod(field_detail, field_detail_place(p, density), max(0.0, field_octaves(0.5 * texel) + 3.0)).x - textureLod(field_detail, vec2(0.5), 20.0).x;
	float billow = cloud_field.w * lump * clamp((finest - 30.0) / 60.0, 0.0, 1.0) * smoothstep(0.0, 100.0, height);
	STORE(0, vec4(clamp(height + billow, 0.0, cloud_layer.y), 0.0, 0.0, 1.0));
}
