// Reflectance of the ground out of its painted picture (shaders/lib/ground_paint.glsl).
#ifndef SHADERS_LIB_GROUND
#define SHADERS_LIB_GROUND
#include "shaders/lib/scene_block.glsl"

#ifndef __cplusplus
uniform sampler2D ground_map;
uniform sampler2D ground_relief;
#endif

const float GROUND_RELIEF_TILE = 80.0; // m
const float GROUND_FINE_TILE = 5.3;
const float GROUND_RELIEF_FADE = 0.5; // footprint, m, at which half of the relief is left
const float GROUND_RELIEF_SIZE = 256.0;

// place: metres east and north; footprint: size of what is averaged, m. Per band.
vec3 ground_reflectance(vec2 place, float footprint)
{
	float tile = ground_mean_albedo.w;
	float texel = tile / ground_patch.x;
	vec3 albedo = vec3(textureLod(ground_map, place / tile, max(0.0, log2(footprint / texel))));
	// Close by, where a texel of the picture fills the view: two scales of relief. Grass and soil are rough, ice and water less so.
	float lod = max(0.0, log2(footprint * GROUND_RELIEF_SIZE / GROUND_RELIEF_TILE));
	float fine_lod = max(0.0, log2(footprint * GROUND_RELIEF_SIZE / GROUND_FINE_TILE));
	// Farther away, where many of its tiles are in view, the relief would show its repeat: it fades before.
	float fade = 1.0 / (1.0 + footprint * footprint * (1.0 / GROUND_RELIEF_FADE / GROUND_RELIEF_FADE));
	float relief = fade * (textureLod(ground_relief, place / GROUND_RELIEF_TILE, lod).x + textureLod(ground_relief, place / GROUND_FINE_TILE, fine_lod).x);
	return albedo * max(1.0 + ground_patch.y * relief, 0.25);
}
#endif
