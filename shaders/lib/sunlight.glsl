// What the sun and the sky send to a point in the air, out of the tables of the sky stage.
#ifndef SHADERS_LIB_SUNLIGHT
#define SHADERS_LIB_SUNLIGHT
#include "shaders/lib/atmosphere.glsl"

#ifndef __cplusplus
uniform sampler2D transmittance_table;
#endif

// Transmittance of the air from height h towards a sun at cosine mu; fades over the disc of the sun as it sets behind the horizon. w: the way
// that the beam has come through aerosol, in metres of its density at the ground.
vec4 sun_passage(float h, float mu)
{
	float horizon = sphere_horizon(h);
	float above = smoothstep(-sun_direction.w, sun_direction.w, mu - horizon);
	if (above <= 0.0)
		return vec4(0.0);
	vec4 passage = textureLod(transmittance_table, transmittance_coordinates(h, max(mu, horizon)), 0.0);
	return vec4(above * vec3(passage), passage.w);
}

// Transmittance of light that the forward peak of the aerosol did not take away (delta-M scaling). Where nothing is left the exponent, which may be large, does
// not matter.
vec3 sun_transmittance_scaled(float h, float mu)
{
	vec4 passage = sun_passage(h, mu);
	return vec3(passage) * exp(min(atmosphere_forward(0.0) * passage.w, vec3(60.0)));
}

vec3 sun_transmittance(float h, float mu)
{
	return vec3(sun_passage(h, mu));
}

// Irradiance by the sun on a plane normal to its beam, W/m2/nm.
vec3 sun_irradiance(float h, float mu)
{
	return vec3(solar_irradiance) * sun_transmittance(h, mu);
}
#endif
