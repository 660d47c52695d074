/* The sun's disc in a picture: how much of the direct light each pixel holds, so that the sum over the picture is all of it, however coarse
 * or bent the pixels are. Any thread.
 */
#ifndef STRATUS_RENDERER_SUN_DISC_H
#define STRATUS_RENDERER_SUN_DISC_H

#include "renderer/camera.h"

/* What a cloud layer leaves of the beam over the disc. */
enum { SUN_COVER_SIDE = 32 };
struct sun_cover {
	float a[3], b[3]; /* unit vectors square to the sun and to each other */
	/* Per band, in a square of texels round the disc: from -radius to +radius along a, and row by row along b. */
	float share[SUN_COVER_SIDE][SUN_COVER_SIDE][4];
};

/* The vectors; all shares 1. sun: direction of length 1. */
void sun_cover_clear(struct sun_cover *cover, const double sun[3]);

/* Mean share over the disc's light per band. */
void sun_cover_mean(const struct sun_cover *cover, double mean[3]);

struct sun_disc {
	int column, row;   /* upper left corner of the box of pixels that hold some of the disc */
	int width, height; /* of the box; 0: the view does not show the disc */
	/* Per pixel of the box, row by row: share of the disc's light over the pixel's solid angle, 1/sr. Times solid angles it adds up to
	 * 1 when the view shows the whole disc. A box that reaches over the right edge of an equirectangular picture goes on at the left.
	 */
	float *weights;
	float (*passed)[3]; /* per pixel of the box and band: share of that light that the cover leaves */
	bool large;         /* instead: a perspective's disc over so many pixels that each can be taken by itself (sun_disc.glsl) */
	double visible;     /* share of the disc's light that comes from above the horizon */
};

/* Limb darkening: radiance at the share rho of the radius over that at the middle is 1 - u (1 - sqrt(1 - rho^2)); u = 0.6 in the visible
 * (Allen 1973, Astrophysical Quantities). */
#define SUN_LIMB_DARKENING 0.6

/* Spreads the disc (direction `sun` of length 1, angular radius in rad) over a view's pixels. What of the disc lies below the horizon (sine
 * of its elevation) is left out and the rest made 1; pixels whose centre shows nothing of the sky, below the horizon or beyond the
 * fisheye's circle, leave their share to their neighbours. cover: NULL is none. false when out of memory. */
bool sun_disc_init(struct sun_disc *disc, const struct camera_view *view, const double sun[3], double radius, double horizon_sine,
		   const struct sun_cover *cover);

/* Takes a zeroed disc. */
void sun_disc_finish(struct sun_disc *disc);

#endif
