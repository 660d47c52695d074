/* Radiance of a clear sky by photons traced backwards over a spherical Earth, light polarised or not being all the same: shares with the
 * renderer's sky what air consists of, and nothing of how it is computed. For tests and the validation.
 */
#ifndef STRATUS_TESTS_VALIDATE_AIR_PHOTONS_H
#define STRATUS_TESTS_VALIDATE_AIR_PHOTONS_H

#include <stdint.h>

/* Air at one wavelength over Lambertian ground: vertical optical thicknesses from the ground. Profiles and phase functions are those of
 * renderer/stages/sky.c. */
struct air {
	double rayleigh, aerosol, ozone;
	double aerosol_albedo, aerosol_asymmetry;
	double ground_albedo;
};

struct air_radiance {
	double mean, error; /* over the solar irradiance, 1/sr; standard error */
};

/* Seen from `height` (m) along a direction (unit, z up), the sun being in the plane y = 0 on the side of x > 0 at a zenith angle in
 * radians, 0..pi. photons from 2. Advances the random state. Any thread. */
struct air_radiance air_photons_radiance(const struct air *air, double height, const double direction[3], double sun_zenith, int photons,
					 uint64_t *state);

/* Transmittance of the air from a height to a sun at that zenith angle, 0 behind the Earth. */
double air_sun_transmittance(const struct air *air, double height, double sun_zenith);

#endif
