#include "renderer/exposure.h"

#include "renderer/stages/colour.h"

#include <math.h>

/* From above a layer is looked at that sends back half to three quarters of what it gets: as snow in the sun is, it is exposed for more
 * than a grey mean, so that it comes out white. As far as the sun lights it. */
static const double exposure_above_ev = 0.25;

/* The sky that a low sun shines through is far brighter on its side than all round: as much of the beam counts as that does, and as clouds
 * let through. */
static double low_sun_share(double elevation_deg, const struct scene_light *light)
{
	const double mu = sin(elevation_deg * M_PI / 180);
	const double passed = mu > 0 ? fmin(light->direct / (mu * light->beam + 1e-9), 1) : 0;
	return 0.2 * exp(-pow(elevation_deg / 8, 2)) * passed;
}

/* What counts is what a picture of the sky shows: diffuse light
 * most of all, sunlight on the ground by a fifth, and a little of the beam itself, which a low sun sends along the ground into the sky that
 * is looked at. A white sheet in that light comes out at 0.6 before tone, and full sunlight as a camera has it at 1/100 s, f/16 and ISO
 * 100; most of a change of light is followed, as an eye does, but not all, so that dusk stays darker than noon. */
double exposure_ev(const struct scene *scene, const struct scene_light *light)
{
	if (!scene->output.exposure_auto)
		return scene->output.exposure_ev;
	const bool above = scene_has_clouds(scene) && scene->camera.position_m[2] >= scene->clouds.base_m;
	const double lux = fmax(
		0.65 * light->diffuse + 0.21 * light->direct + (0.08 + low_sun_share(scene->sun.elevation_deg, light)) * light->beam, 1e-2);
	return log2(0.6 * M_PI * COLOUR_WHITE_LUMINANCE / lux) + 0.18 * log2(lux / 40000) +
	       (above ? exposure_above_ev * light->direct / (light->direct + light->diffuse + 1e-9) : 0);
}
