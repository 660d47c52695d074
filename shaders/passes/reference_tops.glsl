// Heights of the tops above the base for the reference model, in the frame of the drifting clouds: those that the slab shows, fine. arguments[0].x: texels a side.
#include "shaders/lib/field_warp.glsl"
#if REFERENCE_ABOVE
#include "shaders/lib/height.glsl"
#else
#include "shaders/lib/field.glsl"
#endif

void pass(ivec2 pixel)
{
	vec2 uv = (vec2(pixel) + 0.5) / arguments[0].x;
#if REFERENCE_ABOVE
	float top = textureLod(height_table, uv, 0.0).x * cloud_layer.y;
#else
	float top = field_thickness(uv * cloud_layer.z + vec2(cloud_drift), cloud_layer.z / arguments[0].x);
#endif
	STORE(0, vec4(top, 0.0, 0.0, 1.0));
}
