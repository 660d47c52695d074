/* Weights of the kernels that stand for the exchange of light between two parallel planes (shaders/lib/radiosity.glsl). Any thread. */
#ifndef STRATUS_RENDERER_STAGES_EXCHANGE_WEIGHTS_H
#define STRATUS_RENDERER_STAGES_EXCHANGE_WEIGHTS_H

/* Texels of a plane's side, and levels of its pyramid down to one texel. */
enum { EXCHANGE_SIDE = 128, EXCHANGE_LEVELS = 8 };

/* Transform of the exchange kernel h^2 / (pi (h^2 + d^2)^2) at wave number k: k h K_1(k h), 1 at k = 0. */
double exchange_kernel_transform(double wave_number_per_m, double distance_m);

/* Transform of level `level`'s kernel, averaged over directions: a texel's box, the reductions 1 3 3 1 that lead to the level, and the
 * cubic B-spline that reads it. texel_m: size of a texel of level 0. */
double exchange_level_transform(double wave_number_per_m, double texel_m, int level);

/* Weights per level, none negative, sum 1, by least squares over the wave numbers of the tile, weighted as a square emitter has them.
 * tile_m, distance_m > 0. */
void exchange_weights(double tile_m, double distance_m, double weights[EXCHANGE_LEVELS]);

#endif
