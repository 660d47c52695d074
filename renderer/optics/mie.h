/* Mie series of one homogeneous sphere that does not absorb.
 *
 * x = 2 pi r / lambda is the size parameter, m the refractive index relative to the surroundings (real, any m > 0). Notation and signs
 * of a_n, b_n, S1, S2 are those of Bohren & Huffman 1983, chapter 4. Verified for x in 0.01..10000. All functions are pure: any thread.
 */
#ifndef STRATUS_RENDERER_OPTICS_MIE_H
#define STRATUS_RENDERER_OPTICS_MIE_H

#include <complex.h>

/* Coefficients a_n and b_n of the scattered field; terms[0] holds n = 1. */
struct mie_term {
	double complex a, b;
};

/* Efficiencies relative to the geometric cross-section pi r^2; asymmetry g = <cos theta>, -1..1. */
struct mie_efficiency {
	double extinction, scattering, asymmetry;
};

/* Terms after which the series has converged to double precision (Wiscombe 1980). x > 0. */
int mie_term_count(double x);

/* Doubles of scratch memory that mie_terms wants. */
int mie_scratch_count(double x, double m);

/* Fills terms[mie_term_count(x)]; scratch[mie_scratch_count(x, m)] is left with no meaning. Cannot fail. */
void mie_terms(double x, double m, struct mie_term *terms, double *scratch);

/* Sums of the series. Extinction and scattering are summed independently: their difference is the rounding error. */
struct mie_efficiency mie_efficiency(double x, const struct mie_term *terms, int count);

/* Amplitudes S1 (across the scattering plane) and S2 (in it) at cos_theta in -1..1, without unit. */
void mie_amplitudes(const struct mie_term *terms, int count, double cos_theta, double complex amplitude[2]);

/* Phase function for unpolarised light, normalised to an integral of 4 pi: 2 (|S1|^2 + |S2|^2) / (x^2 Q_sca). */
double mie_phase(double x, double scattering_efficiency, const double complex amplitude[2]);

#endif
