// The plane-parallel slab of Bouthors, Neyret, Lefebvre 2006, with the normalisations corrected: radiances for an irradiance of 1 on a plane normal to the
// beam. tau is the modified (kappa_S) optical thickness along the normal, mu_l and mu_v the cosines of light and view to it, both positive.
#ifndef SHADERS_LIB_SLAB
#define SHADERS_LIB_SLAB
#include "shaders/lib/optics.glsl"

#ifndef __cplusplus
uniform sampler2D slab_table;
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

// --- table over thickness: columns over the square root of H over its maximum, rows of single quantities, then one per view zenith ---

const vec2 SLAB_TABLE_SIZE = vec2(256.0, 38.0);
const float SLAB_TABLE_SINGLE = 6.0;
const float SLAB_VIEWS = 32.0;

vec3 slab_row(float thickness, float row)
{
	float unit = sqrt(clamp(thickness / max(cloud_layer.y, 1e-3), 0.0, 1.0));
	return vec3(textureLod(slab_table, (vec2(unit * (SLAB_TABLE_SIZE.x - 1.0), row) + 0.5) / SLAB_TABLE_SIZE, 0.0));
}

// Fraction of the sun's flux on the slab that leaves it as diffuse light through the other side, or back: scattered three times and oftener in
// the paper's model, all that is not slab_directional_transmittance in the solved one.
vec3 slab_multiple(float thickness, bool through)
{
	return slab_row(thickness, through ? 0.0 : 2.0);
}

// Factor that gives double scattering, of single scattering's shape and P_2, its flux T_2 or R_2.
vec3 slab_double_scale(float thickness, bool through)
{
	return slab_row(thickness, through ? 1.0 : 3.0);
}

// What goes on nearly along the beam: T_0 + T_1 + T_2 in the paper's model, T_0 + T_1 in the solved one.
vec3 slab_directional_transmittance(float thickness)
{
	return slab_row(thickness, 4.0);
}

// Albedo for uniform diffuse light.
vec3 slab_spherical_albedo(float thickness)
{
	return slab_row(thickness, 5.0);
}

// Index of a view's zenith angle in the tables, denser towards the horizon: the angle is pi/2 sin(pi/2 i/(SLAB_VIEWS-1)).
float slab_view_index(float mu_v)
{
	return (SLAB_VIEWS - 1.0) * (2.0 / PI) * asin(min(acos(clamp(mu_v, 0.0, 1.0)) * (2.0 / PI), 1.0));
}

// Of uniform diffuse light that meets droplets on its way, the share that is seen through the layer; the rest is seen reflected by it.
vec3 slab_diffuse_share(float thickness, float view_index)
{
	return slab_row(thickness, SLAB_TABLE_SINGLE + view_index);
}
#endif
