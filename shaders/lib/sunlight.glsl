// What the sun and the sky send to a point in the air, out of the tables of the sky stage.
#ifndef SHADERS_LIB_SUNLIGHT
#define SHADERS_LIB_SUNLIGHT
#include "shaders/lib/atmosphere.glsl"

#ifndef __cplusplus
uniform sampler2D transmittance_table;
#endif

// Transmittance of the air from height h towards a sun at cosine mu; fades over the disc of the sun as it sets behind the horizon.
vec3 sun_transmittance(float h, float mu)
{
	float horizon = sphere_horizon(h);
	float above = smoothstep(-sun_direction.w, sun_direction.w, mu - horizon);
	if (above <= 0.0)
		return vec3(0.0);
	return above * vec3(textureLod(transmittance_table, transmittance_coordinates(h, max(mu, horizon)), 0.0));
}

// Irradiance by the sun on a plane normal to its beam, W/m2/nm.
vec3 sun_irradiance(float h, float mu)
{
	return vec3(solar_irradiance) * sun_transmittance(h, mu);
}
#endif
