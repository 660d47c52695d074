/* Exchange of diffuse light between the cloud base and the ground: parallel planes at a distance h, periodic over one tile.
 *
 * A plane is a picture of texels of uniform radiosity. What a point of the other plane receives from a texel is the texel's form factor,
 * summed over all periods: a convolution, done in Fourier space and exact for any ratio of texel, h and tile. The factors are all
 * positive and their sum is 1: nothing is created or lost. The base's pictures are kept in the frame of the drifting clouds, so that they
 * move over the ground by any fraction of a texel without being resampled.
 */
#ifndef STRATUS_RENDERER_STAGES_EXCHANGE_H
#define STRATUS_RENDERER_STAGES_EXCHANGE_H

#include "renderer/stages/fourier.h"

#include <stdbool.h>

enum { EXCHANGE_BANDS = 3, EXCHANGE_SIDE_MIN = 16, EXCHANGE_SIDE_MAX = FOURIER_SIDE_MAX };

/* Texels to the distance h, below which received light has no detail: squares of any size and place, read linearly between the texels'
 * centres, are then within 2 % of the emitter's value. */
#define EXCHANGE_TEXELS 3.2

/* Texels a side: a power of two, enough for that up to tiles of 160 h; EXCHANGE_SIDE_MIN.._MAX. tile_m, distance_m > 0. */
int exchange_side(double tile_m, double distance_m);

/* Form factor of a rectangle in a parallel plane at distance 1 with one corner above the point and sides x and y; odd in both. (J. R.
 * Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-3.) */
double exchange_corner_factor(double x, double y);

/* Transform of the texels' form factors, over side^2; malloc'd, side x side in the order of fourier_forward. NULL when out of memory. */
float *exchange_kernel_create(int side, double tile_m, double distance_m);

enum exchange_way {
	EXCHANGE_DOWN, /* the base sends in the clouds' frame, the ground receives in its own */
	EXCHANGE_UP,   /* the ground sends, the base receives in the clouds' frame */
	EXCHANGE_LEVEL /* both in one frame */
};

struct exchange {
	struct fourier fourier;
	const float *kernel;
	float shift[2][2][EXCHANGE_SIDE_MAX]; /* phases by the drift: along x by row and along y by column of the transform; re, im */
	float *scratch;                       /* four planes */
};

/* kernel must outlive it; drift: of the clouds over the ground, in tiles. false when out of memory. One thread at a time. */
bool exchange_init(struct exchange *exchange, int side, const float *kernel, const double drift[2]);
void exchange_finish(struct exchange *exchange);

/* Irradiance out of radiosity. Both: bands, one side x side plane after the other; may be the same. */
void exchange_receive(struct exchange *exchange, enum exchange_way way, const float *sends, float *received);

#endif
