#include "renderer/stages/ground.h"

#include <math.h>

/* Means over a tile of 20 km of what shaders/lib/ground.glsl draws, and its brightest part. */
static const struct {
	double mean[3], brightest;
} grounds[GROUND_TYPE_COUNT] = {
	[GROUND_COUNTRY] = {{0.0940, 0.1035, 0.0468}, 0.25},
	[GROUND_SEA] = {{0.045, 0.055, 0.07}, 0.07},
	[GROUND_SEA_ICE] = {{0.52, 0.56, 0.58}, 0.80},
	[GROUND_SNOW] = {{0.84, 0.86, 0.87}, 0.87},
	[GROUND_BLACK] = {{0, 0, 0}, 0},
	[GROUND_LAMBERT] = {{1, 1, 1}, 1},
};

double ground_mean_reflectance(const struct scene_ground *ground, double mean[3])
{
	double largest = 0;
	for (int band = 0; band < 3; band++) {
		const double scale = ground->albedo_scale * (ground->type == GROUND_LAMBERT ? ground->albedo[band] : 1);
		mean[band] = fmin(1, grounds[ground->type].mean[band] * scale);
		largest = fmax(largest, fmin(1, grounds[ground->type].brightest * scale));
	}
	return largest;
}
