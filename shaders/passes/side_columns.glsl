// Columns of the layer in the sun. x, y: light that is scattered often at the base and half way up to the top, times z: thickness, m; w: thickness that the beam passes to the base, along the vertical, m.
// arguments[0].x: texels a side.
#include "shaders/lib/side_light.glsl"

uniform sampler2D thickness;

const int COLUMN_STEPS = 8;

// Cloud from one height to another on the sun's beam through a place at height z, m; positive upwards.
float column_passed(vec2 uv, float z, float from, float to)
{
	float rise = height_sun_rise();
	vec2 slope = height_sun_heading() / (rise * cloud_layer.z);
	float dz = (to - from) / float(COLUMN_STEPS);
	float lod = max(0.0, log2(max(dz / rise * arguments[0].x / cloud_layer.z, 1e-3)));
	float sum = 0.0;
	for (int i = 0; i < COLUMN_STEPS; i++) {
		float low = from + dz * float(i);
		sum += side_filled(textureLod(thickness, uv + slope * (low + 0.5 * dz - z), lod).x, low, low + dz);
	}
	return sum;
}

// Share of what diffuses through `whole` that leaves a column of h on this side: behind a thicker cloud it is near the other side too, and light leaves by both.
float column_leaves(float h, float whole)
{
	return 0.5 + 0.5 * min(h / max(whole, 1.0), 1.0);
}

void pass(ivec2 pixel)
{
	vec2 uv = (vec2(pixel) + 0.5) / arguments[0].x;
	float h = texelFetch(thickness, pixel, 0).x;
	float passed = column_passed(uv, 0.0, 0.0, cloud_layer.y);
	float side = 0.5 * h;
	float above = column_passed(uv, side, side, cloud_layer.y);
	float behind = column_passed(uv, side, 0.0, side);
	float weight = h + 1e-2;
	STORE(0, vec4(weight * side_source(passed, 0.0) * column_leaves(h, passed), weight * side_source(above, behind) * column_leaves(h, above + behind), weight, passed));
}
