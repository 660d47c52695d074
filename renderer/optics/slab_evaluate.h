/* What evaluation of a solution and its tables share. Private to renderer/optics. */
#ifndef STRATUS_RENDERER_OPTICS_SLAB_EVALUATE_H
#define STRATUS_RENDERER_OPTICS_SLAB_EVALUATE_H

#include "renderer/optics/slab.h"

enum { STENCIL = 4 };

/* Four neighbours on a grid of unit steps and Lagrange's coefficients. */
struct stencil {
	int first;
	double factor[STENCIL];
};

/* At x in 0..count-1, of a grid of `count` >= 4; beyond it by the same cubic. */
struct stencil stencil_at(double x, int count);

/* Coefficients of the polynomial through the solution's nodes, at mu in 0..1. */
void slab_node_factors(const struct slab_solution *solution, double mu, double factor[SLAB_NODE_COUNT]);

/* Transmittance of a layer thicker than the table's last over that of the last: asymptotic theory, 1/(tau + q); else 1. */
double slab_thick_share(const struct slab_band *band, double tau);

/* Radiance of orders >= 2 over K: mu_l/pi (1 - exp(-tau'/mu_l)) (1 - exp(-tau'/mu_v)). Arguments in range. */
double slab_multiple_scale(const struct slab_band *band, double tau, double mu_l, double mu_v);

/* Radiance of light scattered once by a layer of depth tau >= 0, over P/(4 pi) and F0, and in *depth the mean slant depth that it came
 * through: mu_l/(mu_l+mu_v) (1 - exp(-tau/mu_l - tau/mu_v)) reflected, mu_l/(mu_l-mu_v) (exp(-tau/mu_l) - exp(-tau/mu_v)) transmitted.
 * Finite everywhere, also at mu_l = mu_v and at 0; mu_l and mu_v in 0..1. */
double slab_single_geometry(enum slab_side side, double tau, double mu_l, double mu_v, double *depth);

#endif
