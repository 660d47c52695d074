// Rays over a spherical Earth. Heights are metres above the ground and distances metres along the ray; radii of 6.4e6 m are never squared and
// subtracted, since single precision would leave errors of metres.
#ifndef SHADERS_LIB_SPHERE
#define SHADERS_LIB_SPHERE
#include "shaders/lib/scene_block.glsl"

// Distance along a ray (from height h, cosine mu to the local vertical) to the sphere of height `target`: the far crossing for a target above or one
// crossed twice from below, negative when the sphere is never reached.
float sphere_distance_up(float h, float mu, float target)
{
	float r = EARTH_RADIUS + h;
	float c = (target - h) * (2.0 * EARTH_RADIUS + target + h);
	float b = r * mu;
	float root = b * b + c;
	if (root < 0.0)
		return -1.0;
	root = sqrt(root);
	return b > 0.0 ? c / (b + root) : root - b;
}

// The near crossing, for a ray that goes down to a sphere below it; negative when it passes above.
float sphere_distance_down(float h, float mu, float target)
{
	float r = EARTH_RADIUS + h;
	float c = (target - h) * (2.0 * EARTH_RADIUS + target + h);
	float b = r * mu;
	float root = b * b + c;
	if (mu >= 0.0 || root < 0.0 || c > 0.0)
		return -1.0;
	return -c / (sqrt(root) - b);
}

// Height after a distance t.
float sphere_height(float h, float mu, float t)
{
	float r = EARTH_RADIUS + h;
	float rise = t * (2.0 * r * mu + t);
	return h + rise / (sqrt(max(r * r + rise, 0.0)) + r);
}

// Cosine to the local vertical after a distance t, at a point of height `height`.
float sphere_cosine(float h, float mu, float t, float height)
{
	return clamp(((EARTH_RADIUS + h) * mu + t) / (EARTH_RADIUS + height), -1.0, 1.0);
}

// Sine of the (negative) elevation of the horizon seen from height h.
float sphere_horizon(float h)
{
	return -sqrt(max(h, 0.0) * (2.0 * EARTH_RADIUS + h)) / (EARTH_RADIUS + h);
}
#endif
