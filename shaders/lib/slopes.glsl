// Surfaces whose slopes are normally distributed: what a viewer or the sun meets of them.
#ifndef SHADERS_LIB_SLOPES
#define SHADERS_LIB_SLOPES
#include "shaders/lib/scene_block.glsl"

// Share of a normal distribution below u, by a logistic curve: within 2e-4 (Bowling et al. 2009).
float normal_below(float u)
{
	return 1.0 / (1.0 + exp(-clamp(u * (1.5976 + 0.07056 * u * u), -60.0, 60.0)));
}

float normal_density(float u)
{
	return 0.39894228 * exp(-0.5 * u * u);
}

// Mean of max(0, u + x) over a normal x. With u the tangent of the elevation over the slopes' deviation, this times the deviation times the cosine of the elevation is
// the area that a rough surface shows to that direction, over its horizontal one, before one part hides another. Over u it is 1 + Smith's lambda, so that
// its inverse is Smith's shadowing (Smith 1967), whose sum of seen areas is the horizontal one.
float normal_ramp(float u)
{
	return max(u * normal_below(u) + normal_density(u), 1e-6);
}
#endif
