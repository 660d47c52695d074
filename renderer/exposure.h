/* Automatic exposure: out of the light in a scene alone, never out of the picture. Pure; any thread. */
#ifndef STRATUS_RENDERER_EXPOSURE_H
#define STRATUS_RENDERER_EXPOSURE_H

#include "renderer/scene.h"

/* What counts: mean horizontal illuminances over the tile, direct and diffuse, and of the beam on a plane normal to it, above the clouds;
 * lux. Not those at the camera, since a picture must not brighten when a cloud passes before the sun. */
struct scene_light {
	double direct, diffuse, beam;
};

/* Exposure of a picture of this scene, EV: doublings of luminance over COLOUR_WHITE_LUMINANCE. light: read only where the scene leaves the
 * exposure to the renderer. */
double exposure_ev(const struct scene *scene, const struct scene_light *light);

#endif
