/* Against tests/data: Mie theory by another program, discrete ordinates. */
#include "tests/validate/validate.h"

#include <jansson.h>
#include <stdlib.h>

static double number(const json_t *object, const char *key)
{
	const json_t *value = json_object_get(object, key);
	require(json_is_number(value), key);
	return json_number_value(value);
}

static double element(const json_t *array, size_t i)
{
	const json_t *value = json_array_get(array, i);
	require(json_is_number(value), "tests/data: an element is missing");
	return json_number_value(value);
}

static void compare_phase(struct validation *validation, const struct optics *optics, int band, double degrees, double expected)
{
	const double error = fabs(optics_phase(optics, band, degrees * DEGREE) / expected - 1);
	if (degrees >= 1 && degrees <= 178)
		tally_add(&validation->measured.tally[TALLY_PHASE], error, "%g deg, %.0f nm", degrees, band_wavelength_nm[band]);
	else if (degrees == 180)
		tally_add(&validation->measured.tally[TALLY_PHASE_BACKWARD], error, "%.0f nm", band_wavelength_nm[band]);
}

static void compare_band(struct validation *validation, const struct optics *optics, int band, const json_t *expected)
{
	struct tally *tally = validation->measured.tally;
	const double nm = band_wavelength_nm[band];
	const char *degrees;
	json_t *value;
	size_t i;
	require(fabs(number(expected, "lambda_um") * 1000 - nm) < 0.1, "mie.json: another wavelength");
	tally_add(&tally[TALLY_EXTINCTION], fabs(optics->extinction_per_m[band] / number(expected, "kappa_exact_per_m") - 1), "%.0f nm",
		  nm);
	tally_add(&tally[TALLY_ASYMMETRY], fabs(optics->asymmetry[band] - number(expected, "g")), "%.0f nm", nm);
	tally_add(&tally[TALLY_PEAK_FRACTION], fabs(optics->forward_peak_fraction[band] - number(expected, "Pf_5deg")), "%.0f nm", nm);
	json_object_foreach(json_object_get(expected, "P"), degrees, value)
		compare_phase(validation, optics, band, strtod(degrees, NULL), json_number_value(value));
	json_array_foreach(json_object_get(expected, "P_fine"), i, value)
		compare_phase(validation, optics, band, element(value, 0), element(value, 1));
}

static void compare_fluxes(struct validation *validation, const struct solved *solved, const json_t *rows)
{
	struct tally *tally = &validation->measured.tally[TALLY_REFERENCE_FLUX];
	size_t i;
	json_t *row;
	json_array_foreach(rows, i, row)
	{
		const double tau = element(row, 0), zenith = element(row, 1);
		const struct slab_flux flux = slab_flux_at(solved->slab, 1, tau, cos(zenith * DEGREE));
		tally_add(tally, fabs(flux.reflected - element(row, 2)), "R at tau %g, sun at %g deg", tau, zenith);
		tally_add(tally, fabs(flux.transmitted - element(row, 3) - element(row, 4)), "T at tau %g, sun at %g deg", tau, zenith);
	}
}

static void compare_radiances(struct validation *validation, const struct solved *solved, const json_t *grid, const json_t *entry,
			      enum slab_side side)
{
	static const char *const names[] = {"reflected_rows_viewzenith_cols_azimuth", "transmitted_diffuse_rows_viewzenith_cols_azimuth"};
	const json_t *zeniths = json_object_get(grid, "view_zenith_deg"), *azimuths = json_object_get(grid, "relative_azimuth_deg");
	const double tau = number(entry, "tau"), sun = number(entry, "sun_zenith_deg"), mu_l = cos(sun * DEGREE);
	for (size_t i = 0; i < json_array_size(zeniths); i++)
		for (size_t j = 0; j < json_array_size(azimuths); j++) {
			const double expected = element(json_array_get(json_object_get(entry, names[side]), i), j);
			const double mu_v = cos(element(zeniths, i) * DEGREE), azimuth = element(azimuths, j) * DEGREE;
			if (scattering_cosine(side, mu_l, mu_v, azimuth) > cos(3 * DEGREE))
				continue;
			const double value = slab_radiance(solved->slab, solved->optics, 1, side, tau, mu_l, mu_v, azimuth);
			tally_add(&validation->measured.tally[TALLY_REFERENCE_RADIANCE], fabs(value / expected - 1),
				  "tau %g, sun at %g, %s, view at %g deg, azimuth %g", tau, sun,
				  side == SLAB_REFLECTED ? "reflected" : "transmitted", element(zeniths, i), element(azimuths, j));
		}
}

void validate_reference(struct validation *validation)
{
	json_t *mie = json_load_file("tests/data/mie.json", JSON_REJECT_DUPLICATES, NULL);
	json_t *slab = json_load_file("tests/data/slab.json", JSON_REJECT_DUPLICATES, NULL);
	require(mie && slab, "tests/data cannot be read");
	struct solved solved = solved_init(validation, PAPER_DROPLETS);
	for (int band = 0; band < BAND_COUNT; band++)
		compare_band(validation, solved.optics, band, json_array_get(json_object_get(mie, "b_polydisperse"), (size_t)band));
	compare_fluxes(validation, &solved, json_object_get(json_object_get(slab, "fluxes"), "rows"));
	const json_t *grid = json_object_get(slab, "radiances");
	size_t i;
	json_t *entry;
	json_array_foreach(json_object_get(grid, "cases"), i, entry)
	{
		compare_radiances(validation, &solved, grid, entry, SLAB_REFLECTED);
		compare_radiances(validation, &solved, grid, entry, SLAB_TRANSMITTED);
	}
	solved_finish(&solved);
	json_decref(mie);
	json_decref(slab);
}
