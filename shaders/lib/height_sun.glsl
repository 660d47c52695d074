// The height field in the sun: how high the shadows stand on it, and what falls on its slopes.
#ifndef SHADERS_LIB_HEIGHT_SUN
#define SHADERS_LIB_HEIGHT_SUN
#include "shaders/lib/height.glsl"

#ifndef __cplusplus
uniform sampler2D height_light;
#endif

// Texels a side of the tables of shadow and light.
const float HEIGHT_SIZE_LIGHT = 512.0;
// A sun lower than this throws shadows as if it stood there: beyond, one would lie on all.
const float HEIGHT_SUN_LOWEST = 0.035;
// Facets receive at most so many times what a horizontal plane does.
const float HEIGHT_GAIN_MAX = 8.0;

// Tangent of the sun's elevation.
float height_sun_rise()
{
	float mu = clamp(sun_direction.z, HEIGHT_SUN_LOWEST, 0.9999);
	return mu * inversesqrt(1.0 - mu * mu);
}

// Towards the sun, horizontal, unit.
vec2 height_sun_heading()
{
	vec2 heading = vec2(sun_direction);
	return heading * inversesqrt(max(dot(heading, heading), 1e-12));
}

// Share of the beam that reaches a top of some height where light or shadow of what stands towards the sun begins at `shade`, that height or more. A crest
// lets the beam through over a part of a mean free path, and a pixel that covers much of both shows their mean: `soft`, m.
float height_sunlit(float height, float shade, float soft)
{
	return 1.0 - smoothstep(0.0, 0.4 / extinction_scaled.y + soft, shade - height);
}

// Share of the beam that a thickness scatters.
float height_caught(float thickness)
{
	return 1.0 - exp(-extinction_scaled.y * thickness / max(sun_direction.z, 0.05));
}

// What falls on an area of the top, per horizontal area and relative to what falls on a horizontal plane.
float height_received(float height, vec2 slope, float shade)
{
	float facing = 1.0 - dot(slope, height_sun_heading()) / height_sun_rise();
	return clamp(facing, 0.0, HEIGHT_GAIN_MAX) * height_sunlit(height, shade, 0.0);
}
#endif
