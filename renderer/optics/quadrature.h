/* Gauss-Legendre quadrature. */
#ifndef STRATUS_RENDERER_OPTICS_QUADRATURE_H
#define STRATUS_RENDERER_OPTICS_QUADRATURE_H

/* Nodes in 0..1, ascending, and weights summing to 1, for polynomials up to degree 2 count - 1. count >= 1; time grows as its square (3 ms
 * for 1000). Any thread. */
void quadrature_gauss(int count, double *node, double *weight);

#endif
