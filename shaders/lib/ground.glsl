// Reflectance of the ground out of its painted picture (shaders/lib/ground_paint.glsl).
#ifndef SHADERS_LIB_GROUND
#define SHADERS_LIB_GROUND
#include "shaders/lib/scene_block.glsl"

#ifndef __cplusplus
uniform sampler2D ground_map;
#endif

// place: metres east and north; footprint: size of what is averaged, m. Per band.
vec3 ground_reflectance(vec2 place, float footprint)
{
	float tile = ground_mean_albedo.w;
	return vec3(textureLod(ground_map, place / tile, max(0.0, log2(footprint * ground_patch.x / tile))));
}
#endif
