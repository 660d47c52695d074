// The view stage: the color, or parts of the picture, chosen by `arguments`: for output i the layer arguments[0][i] (enum layer), and from arguments[1] on the shares
// (0 or 1) of the color's ten summands that are shown. arguments[3].z: row of the picture that is the first in what is seen of the layer from above.
#include "shaders/lib/view.glsl"
#include "shaders/lib/colour.glsl"

#ifndef __cplusplus
uniform sampler2D seen_place;
uniform sampler2D seen_light;
#endif

void view_show_paths(INOUT(view_parts) p)
{
	p.sun_direct *= arguments[1].x;
	p.order0 *= arguments[1].y;
	p.order1 *= arguments[1].z;
	p.order2 *= arguments[1].w;
	p.multiple *= arguments[2].x;
	p.cloud_sky *= arguments[2].y;
	p.cloud_ground *= arguments[2].z;
	p.sky *= arguments[2].w;
	p.ground *= arguments[3].x;
	p.air *= arguments[3].y;
}

vec3 view_layer(view_parts p, int layer)
{
	switch (layer) {
	case 0: return colour_of_bands(view_sum(p));
	case 1: return colour_of_bands(p.sun_direct);
	case 2: return colour_of_bands(p.order0);
	case 3: return colour_of_bands(p.order1);
	case 4: return colour_of_bands(p.order2);
	case 5: return colour_of_bands(p.multiple);
	case 6: return colour_of_bands(p.cloud_sky);
	case 7: return colour_of_bands(p.cloud_ground);
	case 8: return colour_of_bands(p.sky);
	case 9: return colour_of_bands(p.ground);
	case 10: return colour_of_bands(p.air);
	case 11: return p.transmittance;
	case 12: return vec3(p.optical_thickness);
	case 14: return vec3(0.0); // standard error: nothing here is left to chance
	default: return vec3(p.distance);
	}
}

void pass(ivec2 pixel)
{
	vec2 at = vec2(pixel) + 0.5;
	vec3 disc = vec3(sun_at_camera) * sun_disc_share(pixel);
#if VIEW_ABOVE
	ivec2 held = pixel - ivec2(0, int(arguments[3].z));
	view_parts parts = view_ray_seen(camera_ray(at), disc, texelFetch(seen_place, held, 0), texelFetch(seen_light, held, 0));
#else
	view_parts parts = view_ray(camera_ray(at), disc);
#endif
	float shown = camera_shows(at) ? 1.0 : 0.0;
#if VIEW_COLOR_ONLY
	STORE(0, vec4(shown * colour_of_bands(view_sum(parts)), 1.0));
#else
	view_show_paths(parts);
	STORE(0, vec4(shown * view_layer(parts, int(arguments[0].x)), 1.0));
	STORE(1, vec4(shown * view_layer(parts, int(arguments[0].y)), 1.0));
	STORE(2, vec4(shown * view_layer(parts, int(arguments[0].z)), 1.0));
	STORE(3, vec4(shown * view_layer(parts, int(arguments[0].w)), 1.0));
#endif
}
