/* Optical properties of a droplet size distribution in the three bands, by Mie theory.
 *
 * A kernel table (renderer/optics/kernel.h) holds the scattering functions over size parameter and angle; a distribution only weighs
 * them, so that any distribution costs milliseconds. Phase functions are normalised to an integral of 4 pi over the sphere.
 */
#ifndef STRATUS_RENDERER_OPTICS_OPTICS_H
#define STRATUS_RENDERER_OPTICS_OPTICS_H

#include "renderer/scene.h"

struct kernel;

enum { BAND_COUNT = 3 };

/* Wavelengths of the bands in nm (650, 550, 450) and the refractive index of water there (1.331, 1.333, 1.337; not absorbing). */
extern const double band_wavelength_nm[BAND_COUNT];
extern const double band_refractive_index[BAND_COUNT];

/* Half-angle of the forward peak F of the paper's modified Mie model (section 4.1), 5 degrees, in radians. */
#define FORWARD_PEAK_ANGLE 0.08726646259971647

/* Read-only once made; may be shared between threads. */
struct optics {
	double extinction_per_m[BAND_COUNT];         /* kappa; by the paper's rule when the model says so */
	double asymmetry[BAND_COUNT];                /* g = chi_1, -1..1 */
	double single_scattering_albedo[BAND_COUNT]; /* 1: water does not absorb in the visible */
	double forward_peak_fraction[BAND_COUNT];    /* P_f, fraction of P within FORWARD_PEAK_ANGLE */

	int angle_count;
	double *angle;              /* [angle_count] radians, ascending, first 0, last pi */
	double *weight;             /* [angle_count] quadrature in cos(angle): sum weight f = integral f(mu) dmu over -1..1 */
	int forward_count;          /* angles [0, forward_count) lie inside the forward peak */
	double *phase[BAND_COUNT];  /* P at those angles */
	double *phase2[BAND_COUNT]; /* P_2, the convolution of P_S with itself, at those angles */

	int moment_count;
	double *moment[BAND_COUNT];          /* chi_l of P, l = 0 .. moment_count-1, chi_0 = 1 */
	double *moment_forward[BAND_COUNT];  /* chi_l of P_F (the peak alone, normalised) */
	double *moment_modified[BAND_COUNT]; /* chi_l of P_S (P without the peak, normalised) */
};

/* Computes the optics of a distribution, 5 ms; any thread. NULL (and a log line) when out of memory, or when the kernel's phase function
 * contradicts its series (norm or g off by 1e-3), which a table as made by kernel_generate never does. */
struct optics *optics_create(const struct kernel *kernel, const struct scene_dsd *dsd, enum optics_model model);
void optics_destroy(struct optics *optics);

/* P at an angle in 0..pi (clamped) by interpolation between the table's angles, error 0.01 %, and at most 0.4 % (fogbow
 * of the largest droplets). Any thread. */
double optics_phase(const struct optics *optics, int band, double angle);

/* P_2 likewise. */
double optics_phase2(const struct optics *optics, int band, double angle);

#endif
