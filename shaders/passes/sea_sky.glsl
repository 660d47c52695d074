// Sky and clouds from the sea's surface, for it to mirror: the upper hemisphere as a disc of equal areas. What comes nearly along the sun's beam is left to the glitter.
#include "shaders/lib/sea.glsl"
#include "shaders/lib/view.glsl"

void pass(ivec2 pixel)
{
	view_parts p = view_ray(sea_sky_direction((vec2(pixel) + 0.5) / SEA_SKY_SIZE), vec3(0.0));
	vec3 sum = p.multiple + p.cloud_sky + p.cloud_ground + p.sky + p.air;
	// Under a high sun the beam holds the orders 0 and 1 too (slab_directional_transmittance); what a low one sends to the base from below it does not.
	if (sun_direction.z <= 0.0)
		sum += p.order0 + p.order1;
#if VIEW_CLOUDS && !VIEW_SOLVED
	// As it does order 2 in the paper's shading.
	if (sun_direction.z <= 0.0)
		sum += p.order2;
#endif
	STORE(0, vec4(max(sum, vec3(0.0)), 1.0));
}
