/* What delta-M takes out of the phase function, put back: the tables C_r and C_t of renderer/optics/slab.h.
 *
 * With phi_l = f for l < 32 and chi_l beyond, the peak taken out is f P_F = sum (2l+1) phi_l P_l. Each scattering by P_F turns the light
 * a little, and all of them along a slant depth s (of tau') multiply the Legendre coefficients by exp(-s (f - phi_l)/(1-f)).
 *
 * Transmitted: light that P_F alone scattered has coefficients exp(-s) (exp(-x + y_l) - exp(-x)), x = s f/(1-f), y_l = s phi_l/(1-f).
 * Over the exp(-s) s of single scattering that is P_F's place in the first order, beside P_D:
 *   P_D + sum (2l+1) exp(-x) (exp(y_l) - 1)/s P_l = exp(-x) P/(1-f) + C_t,
 *   C_t = sum (2l+1) [exp(-x) ((exp(y_l) - 1)/s - phi_l/(1-f)) + (1 - exp(-x)) (chi_l - phi_l)/(1-f)] P_l(cos Theta).
 * Split like this C_t is smooth: what is sharp in P was turned by one peak event alone. For thin layers it is 0, so that P/(1-f) is left:
 * Nakajima-Tanaka's TMS. Aureole and TMS are one term and not two.
 *
 * Reflected: the light is turned on its way in and out, which blurs glory and fogbow. With B the part of P that is behind, B(Theta) P
 * with B fading in between 100 and 135 degrees, and beta_l its coefficients,
 *   m(a) = (1 - exp(-s a))/(a (1 - exp(-s))),   a_l = 1 + (f - phi_l)/(1-f),   s = tau'/mu_l + tau'/mu_v,
 * m being the mean over depths of single scattering, P/(1-f) becomes
 *   [1 + B (m(1/(1-f)) - 1)] P/(1-f) + C_r,   C_r = sum (2l+1) beta_l/(1-f) [m(a_l) - m(1/(1-f))] P_l(cos Theta).
 * What is sharp in P was not turned at all, so that C_r is smooth here too, and its series short of the glory's details.
 */
#ifndef STRATUS_RENDERER_OPTICS_SLAB_RESIDUAL_H
#define STRATUS_RENDERER_OPTICS_SLAB_RESIDUAL_H

#include "renderer/optics/slab.h"

/* Angle i, 0..pi, dense at both ends, and its inverse. */
double slab_residual_angle(double i);
double slab_residual_angle_index(double angle);

/* Depth k: s = 4 w/(1 - w) with w = k/(SLAB_RESIDUAL_DEPTH_COUNT - 1), the last one infinite, and the inverse. */
double slab_residual_depth(double k);
double slab_residual_depth_index(double s);

/* Fills band->residual[side] for band->truncated. Any thread. */
void slab_residual_fill(const struct optics *optics, int band, enum slab_side side, struct slab_band *result);

/* S_r and S_t, the factor of P/(1-f) beside the table's value, 0..1: the share of light that P_F turned once alone, or not at all. Any
 * thread. */
double slab_residual_sharp(const struct slab_band *band, enum slab_side side, double angle, double s);

/* The table's value at an angle and depth, by cubics through its neighbours. Any thread. */
double slab_residual_at(const struct slab_band *band, enum slab_side side, double angle, double s);

/* The table's values at an angle at all its depths. Any thread. */
void slab_residual_column(const struct slab_band *band, enum slab_side side, double angle, float column[SLAB_RESIDUAL_DEPTH_COUNT]);

/* Mean of exp(-(a u + b (1 - u))) over u = 0..1 for a, b >= 0 (infinity: 0): attenuation of light scattered once on its way through. */
double slab_mean_attenuation(double a, double b);

/* Mean of a u + b (1 - u) itself over the same, weighted with the exponential. */
double slab_mean_depth(double a, double b);

#endif
