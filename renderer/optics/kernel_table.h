/* Inside of the kernel table: what kernel.c stores, kernel_generate.c computes and optics.c weighs. Private to renderer/optics.
 *
 * Size parameters are nodes uniform in ln x. A quantity at a node is its average over ln x under the node's hat function, so that
 *   integral f(ln x) q(x) d ln x = KERNEL_LOG_STEP sum_i f_i q_i
 * for any f that is linear between nodes. With f = pi r^3 n(r) and q an efficiency this is a distribution's cross-section per volume;
 * the error of taking f for linear is at most 0.1 % (the narrowest distribution, gamma 20, is 20 nodes wide).
 *
 * Angles come in pairs theta, pi - theta, because one pass over the series yields both: pair 0 is exactly 0 and pi with no weight,
 * then Gauss-Legendre nodes of two panels, the forward peak 0..5 degrees and the body 5..90 degrees, so that integrals with the edge of
 * the peak as a limit are exact. Ascending angles: pair k is at k and at KERNEL_ANGLE_COUNT - 1 - k.
 */
#ifndef STRATUS_RENDERER_OPTICS_KERNEL_TABLE_H
#define STRATUS_RENDERER_OPTICS_KERNEL_TABLE_H

#include "renderer/optics/kernel.h"
#include "renderer/optics/optics.h"

#include <stdint.h>

enum {
	KERNEL_NODE_COUNT = 524,
	KERNEL_PEAK_COUNT = 111, /* Gauss-Legendre nodes of the peak: steps of at most 0.08 degrees */
	KERNEL_BODY_COUNT = 456, /* and of the body: at most 0.31 degrees, for the narrow fogbow of large droplets */
	KERNEL_PAIR_COUNT = 1 + KERNEL_PEAK_COUNT + KERNEL_BODY_COUNT,
	KERNEL_ANGLE_COUNT = 2 * KERNEL_PAIR_COUNT
};

/* Range of x: droplets of 0.01 to 250 um at 450 nm. Outside, distributions in range hold less than 1e-6 of their cross-section. */
#define KERNEL_X_MIN 0.1
#define KERNEL_X_MAX 3500.0
/* ln(KERNEL_X_MAX / KERNEL_X_MIN) / (KERNEL_NODE_COUNT - 1) */
#define KERNEL_LOG_STEP 0.0200059337293911

struct kernel_payload {
	double angle[KERNEL_ANGLE_COUNT];                 /* radians, ascending, 0..pi */
	double weight[KERNEL_ANGLE_COUNT];                /* integral f(mu) dmu over -1..1 = sum weight f */
	double extinction[BAND_COUNT][KERNEL_NODE_COUNT]; /* Q_ext, equal to Q_sca */
	double asymmetry[BAND_COUNT][KERNEL_NODE_COUNT];  /* Q_sca g, from the series */
	/* Q_sca P(theta) = 2 (|S1|^2 + |S2|^2) / x^2; its mean over the sphere is Q_sca. */
	float intensity[BAND_COUNT][KERNEL_NODE_COUNT][KERNEL_ANGLE_COUNT];
};

struct kernel {
	unsigned long long hash;
	struct kernel_payload payload;
};

/* Size parameter of a node. */
double kernel_node_x(int node);

/* Fills angle[] and weight[]. */
void kernel_fill_angles(struct kernel_payload *payload);

/* Angle in 0..pi of a position t in 0..1 of the peak's (peak true) or the body's panel, and dangle/dt through slope. */
double kernel_panel_angle(bool peak, double t, double *slope);

/* Computes everything. threads >= 1. false (and a log line) when out of memory or threads. */
bool kernel_fill(struct kernel_payload *payload, int threads, kernel_progress *progress, void *context);

/* Writes the file atomically. false and a log line on failure. */
bool kernel_save(const struct kernel_payload *payload, const char *path);

#endif
