/* Squares of light seen from a parallel plane, as the exchange of ground and clouds has them, against their form factor. Any thread. */
#ifndef STRATUS_TESTS_VALIDATE_SQUARES_H
#define STRATUS_TESTS_VALIDATE_SQUARES_H

/* Form factor of a square of half-width a at the origin of a plane at distance 1, seen from (x, y) of the other. (J. R. Howell, A Catalog
 * of Radiation Heat Transfer Configuration Factors, B-3, by its corners.) */
double square_factor(double a, double x, double y);

/* With all its images in a periodic tile. */
double square_factor_periodic(double a, double x, double y, double tile);

/* Largest difference, over the emitter's value, between the light that a plane has at a distance and the form factor: in front of the
 * square's centre, edge and corner, and outside across an edge, over a corner and far off. Half-width over the distance; where the tile is
 * too small for it, a smaller one of at most 0.4 tiles. Received light is read as the view does, between texels' centres. texel: their size
 * over the distance; where it is above 1/3, which the finest planes of large tiles have, the square is of an even number of whole texels.
 * Negative when out of memory. */
double square_error(double tile_m, double distance_m, double half_width, double *texel);

#endif
