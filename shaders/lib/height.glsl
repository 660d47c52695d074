// The thickness as a picture over the tile: evened out, as light that is scattered often sees it; and for views from above as a height field over the flat
// base, with its means and its maxima over ever larger squares.
#ifndef SHADERS_LIB_HEIGHT
#define SHADERS_LIB_HEIGHT
#include "shaders/lib/field_warp.glsl"
#include "shaders/lib/sphere.glsl"

// height_table: means and maxima, as shares of the highest that a top can be.
#ifndef __cplusplus
uniform sampler2D height_table;
uniform sampler2D smooth_table;
#endif

// Texels a side of the smooth one; of the height field: cloud_puffs.z.
const float HEIGHT_SIZE_SMOOTH = 256.0;

// Height of the top above the base at a place, m, seen at a footprint.
float height_at(vec2 place, float footprint)
{
	float lod = max(0.0, log2(footprint * cloud_puffs.z / cloud_layer.z));
	return textureLod(height_table, field_place(place) / cloud_layer.z, lod).x * cloud_layer.y;
}

// Thickness evened out over the way that light goes sideways, m.
float height_smooth(vec2 place, float footprint)
{
	float lod = max(0.0, log2(footprint * HEIGHT_SIZE_SMOOTH / cloud_layer.z));
	return textureLod(smooth_table, field_place(place) / cloud_layer.z, lod).x;
}

// How the top rises to the east and to the north; differences over `reach`, m, to either side.
vec2 height_slope(vec2 place, float reach)
{
	float dx = height_at(place + vec2(reach, 0.0), reach) - height_at(place - vec2(reach, 0.0), reach);
	float dy = height_at(place + vec2(0.0, reach), reach) - height_at(place - vec2(0.0, reach), reach);
	return vec2(dx, dy) * (0.5 / reach);
}
#endif
