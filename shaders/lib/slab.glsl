// The plane-parallel slab of Bouthors, Neyret, Lefebvre 2006, with the normalisations corrected: radiances for an irradiance of 1 on a plane normal to the
// beam. tau is the modified (kappa_S) optical thickness along the normal, mu_l and mu_v the cosines of light and view to it, both positive.
#ifndef SHADERS_LIB_SLAB
#define SHADERS_LIB_SLAB
#include "shaders/lib/optics.glsl"

#ifndef __cplusplus
uniform sampler2D slab_sun_table;
uniform sampler2D slab_view_table;
#endif

// Single scattering in reflection over P/(4 pi): mu_l / (mu_l + mu_v) (1 - exp(-tau (1/mu_l + 1/mu_v))).
vec3 slab_single_reflected(vec3 tau, float mu_l, float mu_v)
{
	return mu_l / (mu_l + mu_v) * (vec3(1.0) - exp(-tau * (1.0 / mu_l + 1.0 / mu_v)));
}

// The same in transmission: mu_l / (mu_l - mu_v) (exp(-tau/mu_l) - exp(-tau/mu_v)). Written with (1 - exp(-x))/x, which has no singularity at
// mu_l = mu_v: there it is tau/mu_l exp(-tau/mu_l).
vec3 slab_single_transmitted(vec3 tau, float mu_l, float mu_v)
{
	float a = 1.0 / max(mu_l, mu_v);
	float b = 1.0 / min(mu_l, mu_v);
	vec3 x = tau * (b - a);
	vec3 series = vec3(1.0) - x * (0.5 - x * (1.0 / 6.0));
	vec3 exact = (vec3(1.0) - exp(-x)) / max(x, vec3(1e-6));
	vec3 ratio = mix(exact, series, lessThan(x, vec3(0.01)));
	return tau / mu_v * exp(-tau * a) * ratio;
}

// --- tables over thickness, columns over the square root of H over its maximum -------------------------------------------------

const float SLAB_SUN_WIDTH = 256.0;
const float SLAB_SUN_ROWS = 6.0;
const float SLAB_VIEW_SIZE = 64.0;
const float SLAB_VIEW_THICKNESS = 4000.0;

vec3 slab_sun_row(float thickness, float row)
{
	float unit = sqrt(clamp(thickness / max(cloud_layer.y, 1e-3), 0.0, 1.0));
	return vec3(textureLod(slab_sun_table, vec2((0.5 + unit * (SLAB_SUN_WIDTH - 1.0)) / SLAB_SUN_WIDTH, (row + 0.5) / SLAB_SUN_ROWS), 0.0));
}

// Fraction of the sun's flux on the slab that leaves it, scattered three times and oftener, through the other side or back.
vec3 slab_multiple(float thickness, bool through)
{
	return slab_sun_row(thickness, through ? 0.0 : 2.0);
}

// Factor that gives double scattering, of single scattering's shape and P_2, its flux T_2 or R_2.
vec3 slab_double_scale(float thickness, bool through)
{
	return slab_sun_row(thickness, through ? 1.0 : 3.0);
}

// T_0 + T_1 + T_2, what goes on nearly along the beam.
vec3 slab_directional_transmittance(float thickness)
{
	return slab_sun_row(thickness, 4.0);
}

// Albedo for uniform diffuse light.
vec3 slab_spherical_albedo(float thickness)
{
	return slab_sun_row(thickness, 5.0);
}

// Plane transmittance T_ms for light from (by reciprocity: seen under) cosine mu.
float slab_plane_transmittance(float thickness, float mu)
{
	float x = sqrt(clamp(thickness * extinction.w / SLAB_VIEW_THICKNESS, 0.0, 1.0));
	vec2 at = vec2(x, acos(clamp(mu, 0.0, 1.0)) / (0.5 * PI));
	return textureLod(slab_view_table, (0.5 + at * (SLAB_VIEW_SIZE - 1.0)) / SLAB_VIEW_SIZE, 0.0).x;
}
#endif
