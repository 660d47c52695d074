/* Legendre moments of the phase function and their inverse. Private to renderer/optics. */
#ifndef STRATUS_RENDERER_OPTICS_MOMENTS_H
#define STRATUS_RENDERER_OPTICS_MOMENTS_H

#include "renderer/optics/kernel_table.h"

/* The peak's moments last to about l = 2 x: of the broadest distribution with the largest droplets less than 1 % is left at this l. Those
 * of P_F and P_S alone decay like l^-1.5 there, since both jump at the edge of the peak. */
enum { MOMENT_COUNT = 2048 };

/* Moments 1/2 integral P(mu) P_l(mu) dmu of the two halves of P, each normalised to moment 0 = 1. phase[band] holds P at the kernel's
 * angles. Some milliseconds; the first call adds as many for its grid. Any thread. */
void moments_project(const double *const phase[BAND_COUNT], double *const forward[BAND_COUNT], double *const modified[BAND_COUNT]);

/* result[band][angle] = sum (2l+1) coefficient[band][l] P_l(cos angle) at the kernel's angles. Any thread. */
void moments_expand(const double *angle, double coefficient[BAND_COUNT][MOMENT_COUNT], double *const result[BAND_COUNT]);

#endif
