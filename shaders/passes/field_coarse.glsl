// The thickness field before its threshold, over one tile: convective cells, turbulence and mesoscale variation, in standard deviations.
#include "shaders/lib/noise.glsl"

// Wave numbers of the tile from lengths in m, at least one a tile.
int field_period(float metres)
{
	return max(1, int(cloud_layer.z / metres + 0.5));
}

// Octaves of turbulence from a length down to two texels, below which the detail goes on.
int field_octaves(float metres)
{
	return int(clamp(log2(metres * cloud_threshold.w / (2.0 * cloud_layer.z)), 0.0, 9.0)) + 1;
}

float field_stratocumulus(vec2 p, uint seed, float t)
{
	vec2 drift = vec2(cloud_drift.z, cloud_drift.w) / cloud_layer.z;
	int warp_period = field_period(5000.0);
	vec2 warp = vec2(noise_turbulence(p, warp_period, 4, seed + 11u, t / 3000.0), noise_turbulence(p, warp_period, 4, seed + 12u, t / 3000.0));
	int large = field_period(1450.0);
	int small = field_period(520.0);
	float cells = noise_cells(p * float(large) + 0.33 * warp, large, seed + 5u, t / 2400.0, 0.78);
	float cells_small = noise_cells(p * float(small) + 0.66 * warp, small, seed + 6u, t / 1100.0, 0.8);
	float turbulence = noise_turbulence(p - drift, field_period(2500.0), field_octaves(2500.0), seed + 21u, t / 1500.0);
	float meso = noise_turbulence(p, field_period(10000.0), 3, seed + 22u, t / 7000.0);
	return 0.75 * cells + 0.45 * cells_small + 0.30 * turbulence + 0.36 * meso;
}

// A grey sheet: long soft rolls and mesoscale variation, little convection.
float field_stratus(vec2 p, uint seed, float t)
{
	vec2 drift = vec2(cloud_drift.z, cloud_drift.w) / cloud_layer.z;
	vec2 warp = vec2(noise_turbulence(p, field_period(6000.0), 3, seed + 11u, t / 4000.0),
	                 noise_turbulence(p, field_period(6000.0), 3, seed + 12u, t / 4000.0));
	float cells = noise_cells(p * float(field_period(2600.0)) + 0.5 * warp, field_period(2600.0), seed + 5u, t / 4000.0, 1.0);
	float turbulence = noise_turbulence(p - drift, field_period(4000.0), field_octaves(4000.0), seed + 21u, t / 2000.0);
	float meso = noise_turbulence(p, field_period(10000.0), 3, seed + 22u, t / 9000.0);
	return 0.3 * cells + 0.33 * turbulence + 0.5 * meso;
}

void pass(ivec2 pixel)
{
	vec2 p = (vec2(pixel) + 0.5) / cloud_threshold.w;
	uint seed = uint(cloud_field.x);
	float field = cloud_field.w < 0.5 ? field_stratus(p, seed, cloud_field.z) : field_stratocumulus(p, seed, cloud_field.z);
	STORE(0, vec4(field, 0.0, 0.0, 1.0));
}
