/* Small-angle light of the forward peak: paths with any number of forward (F) events, tabulated over angle and depth.
 *
 * Poisson statistics along a path of optical length s = kappa x (full extinction), of which a share P_f are F events:
 *   order 0 (F events alone, n >= 1):  exp(-s) sum_n (P_f s)^n / n! P_F^{*n}
 *   blur of an S event by F events:    P_S convolved with exp(-P_f s) sum_n (P_f s)^n / n! P_F^{*n}
 * In Legendre coefficients (per band): exp(-s)(exp(P_f s chiF_l) - 1) and chiS_l exp(-P_f s (1 - chiF_l)).
 * The terms that are not smooth in angle (n = 1 of the first, n = 0 of the second) are P itself and are left to the caller, so that the two
 * tables below are smooth across the edge of the peak, where both halves meet without a step.
 */
#ifndef STRATUS_RENDERER_OPTICS_FORWARD_H
#define STRATUS_RENDERER_OPTICS_FORWARD_H

#include "renderer/optics/optics.h"

enum { FORWARD_DEPTH_COUNT = 32, FORWARD_ANGLE_COUNT = 128, BLUR_ANGLE_COUNT = 256 };

/* Depth coordinate 0..1 of an optical path s >= 0: w = s / (s + 4), texel centre i at (i + 0.5) / FORWARD_DEPTH_COUNT. */
double forward_depth_coordinate(double s);
double forward_depth_at(double coordinate);

struct forward_tables {
	/* [depth][angle][band], angle i at (i/(FORWARD_ANGLE_COUNT-1))^2 * FORWARD_ANGLE_MAX from the sun: exp(-s) sum_{n>=2} (P_f s)^n/n!
	 * P_F^{*n} / (4 pi), 1/sr. */
	float peak[FORWARD_DEPTH_COUNT][FORWARD_ANGLE_COUNT][BAND_COUNT];
	/* [depth][angle][band], angle i at i/(BLUR_ANGLE_COUNT-1) * pi: P_S blurred minus exp(-P_f s) P_S. Integral over the sphere 4 pi (1
	 * - exp(-P_f s)). */
	float blur[FORWARD_DEPTH_COUNT][BLUR_ANGLE_COUNT][BAND_COUNT];
};

/* Beyond this angle (radians) `peak` is taken as 0. */
#define FORWARD_ANGLE_MAX 0.6

/* Fills the tables, never below 0; 1 to 10 ms, most for the smallest and the largest droplets; takes 0.5 MB of stack; any thread. */
void forward_tables_compute(const struct optics *optics, struct forward_tables *tables);

#endif
