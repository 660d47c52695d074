/* The solved slab. Wants build/mie.kernel, or the file that STRATUS_KERNEL names. STRATUS_SLAB_DROPLETS: how many random distributions. */
#include "renderer/optics/kernel.h"
#include "renderer/optics/slab.h"
#include "tests/unit/numbers.h"

#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define DEGREE (M_PI / 180)

/* The reference's droplets, solved once for all tests. */
struct fixture {
	struct kernel *kernel;
	struct optics *optics;
	struct slab_solution *solution;
	json_t *reference;
};

/* 0..1, the same in every run. */
static double random_unit(void)
{
	static uint64_t state = 7;
	state = state * 6364136223846793005ULL + 1442695040888963407ULL;
	return (double)(state >> 11) * 0x1p-53;
}

static double random_depth(void)
{
	return 0.01 * pow(5e4, random_unit());
}

/* --- against discrete ordinates and photons ------------------------------------------------------------------------------------ */

static void reference_fluxes(void **state)
{
	struct fixture *fixture = *state;
	size_t i;
	json_t *row;
	json_array_foreach(json_object_get(json_object_get(fixture->reference, "fluxes"), "rows"), i, row)
	{
		struct slab_flux flux = slab_flux_at(fixture->solution, 1, element(row, 0), cos(element(row, 1) * DEGREE));
		assert_near(flux.reflected, element(row, 2), 2e-4, "R");
		assert_near(flux.transmitted - flux.direct, element(row, 3), 2e-4, "T, scattered");
		assert_near(flux.direct, element(row, 4), 1e-9, "T, direct");
	}
	assert_true(i >= 8);
}

/* Sums of squared errors outside 3 degrees of the forward direction. */
struct errors {
	double square, worst;
	int count;
};

static void compare_radiances(const struct fixture *fixture, const json_t *grid, const json_t *entry, enum slab_side side,
			      struct errors *errors)
{
	const json_t *rows = json_object_get(entry, side == SLAB_REFLECTED ? "reflected_rows_viewzenith_cols_azimuth"
									   : "transmitted_diffuse_rows_viewzenith_cols_azimuth");
	const json_t *zeniths = json_object_get(grid, "view_zenith_deg"), *azimuths = json_object_get(grid, "relative_azimuth_deg");
	double tau = number(entry, "tau"), sun = number(entry, "sun_zenith_deg") * DEGREE;
	for (size_t i = 0; i < json_array_size(zeniths); i++)
		for (size_t j = 0; j < json_array_size(azimuths); j++) {
			double expected = element(json_array_get(rows, i), j), zenith = element(zeniths, i) * DEGREE;
			double azimuth = element(azimuths, j) * DEGREE;
			double value = slab_radiance(fixture->solution, fixture->optics, 1, side, tau, cos(sun), cos(zenith), azimuth);
			double along = side == SLAB_TRANSMITTED ? cos(sun) * cos(zenith) : -cos(sun) * cos(zenith);
			double error = fabs(value / expected - 1);
			if (along + sin(sun) * sin(zenith) * cos(azimuth) > cos(3 * DEGREE)) {
				assert_near(error, 0, 0.005, "the aureole's centre, relative");
				continue;
			}
			errors->square += error * error;
			errors->worst = fmax(errors->worst, error);
			errors->count++;
		}
}

static void reference_radiances(void **state)
{
	struct fixture *fixture = *state;
	const json_t *grid = json_object_get(fixture->reference, "radiances");
	struct errors errors = {0};
	size_t i;
	json_t *entry;
	json_array_foreach(json_object_get(grid, "cases"), i, entry)
	{
		compare_radiances(fixture, grid, entry, SLAB_REFLECTED, &errors);
		compare_radiances(fixture, grid, entry, SLAB_TRANSMITTED, &errors);
	}
	double rms = sqrt(errors.square / errors.count);
	print_message("radiance: rms %.3f %%, worst %.2f %% of %d\n", 100 * rms, 100 * errors.worst, errors.count);
	assert_true(errors.count > 170);
	assert_near(rms, 0, 0.003, "rms");
	assert_near(errors.worst, 0, 0.015, "worst");
}

static void reference_orders(void **state)
{
	static const char *const names[2][4] = {{"", "R1", "R2", "R3plus"}, {"T0", "T1", "T2", "T3plus"}};
	struct fixture *fixture = *state;
	size_t i;
	json_t *row;
	json_array_foreach(json_object_get(json_object_get(fixture->reference, "orders_of_scattering"), "rows"), i, row)
	{
		bool full = strcmp(json_string_value(json_object_get(row, "phase")), "full") == 0;
		double tau = number(row, "tau_vertical") / (full ? 1 : 1 - number(row, "Pf_5deg"));
		struct slab_orders orders =
			slab_orders_at(fixture->optics, 1, full ? SLAB_PHASE_FULL : SLAB_PHASE_MODIFIED, tau, cos(30 * DEGREE));
		double tolerance = 4 * number(row, "stderr_max");
		for (int order = 0; order < 4; order++) {
			if (order > 0)
				assert_near(orders.r[order], number(row, names[0][order]), tolerance, names[0][order]);
			assert_near(orders.t[order], number(row, names[1][order]), tolerance, names[1][order]);
		}
	}
	assert_int_equal(i, 6);
}

/* --- what must hold for every layer -------------------------------------------------------------------------------------------- */

static void check_conservation(const struct slab_solution *solution, int band)
{
	for (double tau = 0.001; tau < 1e5; tau *= 1.37) {
		for (double zenith = 0; zenith <= 85; zenith += 5) {
			struct slab_flux flux = slab_flux_at(solution, band, tau, cos(zenith * DEGREE));
			assert_near(flux.reflected + flux.transmitted, 1, 1e-5, "R + T");
			assert_true(flux.reflected >= 0 && flux.transmitted >= flux.direct && flux.direct >= 0);
		}
		struct slab_flux flux = slab_flux_spherical(solution, band, tau);
		assert_near(flux.reflected + flux.transmitted, 1, 1e-5, "spherical R + T");
		assert_true(flux.reflected >= 0 && flux.transmitted >= flux.direct && flux.direct >= 0);
	}
}

static void conservation(void **state)
{
	struct fixture *fixture = *state;
	for (int band = 0; band < BAND_COUNT; band++)
		check_conservation(fixture->solution, band);
}

static void reciprocity(void **state)
{
	struct fixture *fixture = *state;
	const struct slab_solution *solution = fixture->solution;
	for (int band = 0; band < BAND_COUNT; band++)
		assert_near(solution->band[band].asymmetry, 0, 1e-6, "difference of transposed elements");
	for (int i = 0; i < 3000; i++) {
		double tau = random_depth(), mu = 0.05 + 0.95 * random_unit(), nu = 0.05 + 0.95 * random_unit(),
		       azimuth = M_PI * random_unit();
		enum slab_side side = i % 2 ? SLAB_REFLECTED : SLAB_TRANSMITTED;
		double there = slab_radiance(solution, fixture->optics, 1, side, tau, mu, nu, azimuth) / mu;
		double back = slab_radiance(solution, fixture->optics, 1, side, tau, nu, mu, azimuth) / nu;
		assert_near(there / back, 1, 1e-4, "reciprocity");
	}
}

/* Flux by radiances over the hemisphere, over azimuth denser towards the sun. */
static double hemisphere(const struct fixture *fixture, int band, enum slab_side side, double tau, double mu_l)
{
	enum { ZENITHS = 200, AZIMUTHS = 120 };
	double sum = 0;
	for (int i = 0; i < ZENITHS; i++) {
		double zenith = (i + 0.5) / ZENITHS * M_PI / 2;
		for (int j = 0; j < AZIMUTHS; j++) {
			double t = (j + 0.5) / AZIMUTHS, weight = cos(zenith) * sin(zenith) * M_PI / 2 / ZENITHS * 4 * M_PI * t / AZIMUTHS;
			sum += weight * slab_radiance(fixture->solution, fixture->optics, band, side, tau, mu_l, cos(zenith), M_PI * t * t);
		}
	}
	return sum / mu_l;
}

static void radiance_adds_up(void **state)
{
	static const double depths[] = {0.05, 0.5, 2, 8, 50, 1000};
	struct fixture *fixture = *state;
	for (size_t i = 0; i < sizeof depths / sizeof *depths; i++)
		for (int k = 0; k < 3; k++) {
			double tau = depths[i], mu_l = (double[]){1, 0.5, 0.1}[k];
			struct slab_flux flux = slab_flux_at(fixture->solution, (int)(i % BAND_COUNT), tau, mu_l);
			double r = hemisphere(fixture, (int)(i % BAND_COUNT), SLAB_REFLECTED, tau, mu_l);
			double t = hemisphere(fixture, (int)(i % BAND_COUNT), SLAB_TRANSMITTED, tau, mu_l);
			assert_near(r, flux.reflected, 0.002, "reflected radiance");
			assert_near(t, flux.transmitted - flux.direct, 0.005, "transmitted radiance");
		}
}

/* Seen at the zenith there is no azimuth, under light that grazes either. */
static void zenith_has_no_azimuth(void **state)
{
	struct fixture *fixture = *state;
	for (int i = 0; i < 200; i++) {
		double tau = random_depth(), mu_l = 0.01 + 0.99 * random_unit();
		enum slab_side side = i % 2 ? SLAB_REFLECTED : SLAB_TRANSMITTED;
		double here = slab_radiance_multiple(fixture->solution, i % BAND_COUNT, side, tau, mu_l, 1, 0);
		for (int k = 1; k <= 6; k++) {
			double there = slab_radiance_multiple(fixture->solution, i % BAND_COUNT, side, tau, mu_l, 1, k * M_PI / 6);
			assert_near(there / here, 1, 1e-9, "another azimuth");
		}
	}
}

/* --- limits -------------------------------------------------------------------------------------------------------------------- */

static void thin_layers_scatter_once(void **state)
{
	struct fixture *fixture = *state;
	for (double tau = 1e-5; tau < 2e-3; tau *= 10)
		for (int i = 0; i < 300; i++) {
			double mu_l = 0.3 + 0.7 * random_unit(), mu_v = 0.3 + 0.7 * random_unit(), azimuth = M_PI * random_unit();
			enum slab_side side = i % 2 ? SLAB_REFLECTED : SLAB_TRANSMITTED;
			double along = side == SLAB_TRANSMITTED ? mu_l * mu_v : -mu_l * mu_v;
			double angle = acos(along + sqrt((1 - mu_l * mu_l) * (1 - mu_v * mu_v)) * cos(azimuth));
			double expected = optics_phase(fixture->optics, 2, angle) / (4 * M_PI) * tau / mu_v;
			double value = slab_radiance(fixture->solution, fixture->optics, 2, side, tau, mu_l, mu_v, azimuth);
			/* The second order comes with tau: 5 forward peaks of it, where P has its least. */
			assert_near(value / expected, 1, 0.002 + 40 * tau, "single scattering");
		}
}

static void thick_layers(void **state)
{
	struct fixture *fixture = *state;
	const struct slab_solution *solution = fixture->solution;
	double before = slab_flux_at(solution, 0, 19.5, 0.6).transmitted;
	for (double tau = 20; tau < 1e7; tau *= 1.05) {
		double t = slab_flux_at(solution, 0, tau, 0.6).transmitted, ratio = before / t;
		assert_true(ratio > 1 && ratio < 1.06);
		before = t;
	}
	/* Diffusion: the similar layer of isotropic scattering, (1-g) tau thick, transmits 4/3 / ((1-g) tau + 1.42) of diffuse light. */
	double g = fixture->optics->asymmetry[1];
	assert_near(slab_flux_spherical(solution, 1, 1e4).transmitted * ((1 - g) * 1e4 + 1.42) / (4.0 / 3), 1, 0.001, "diffusion");
	assert_near(solution->band[1].extrapolation * (1 - g), 1.42, 0.03, "extrapolation length");
	/* No step where the asymptotic theory takes over. */
	for (int side = 0; side < SLAB_SIDE_COUNT; side++) {
		double below = slab_radiance(solution, fixture->optics, 1, side, 551.7, 0.5, 0.7, 1);
		double above = slab_radiance(solution, fixture->optics, 1, side, 552.3, 0.5, 0.7, 1);
		assert_near(above / below, 1, 0.002, "radiance at the end of the table");
	}
	assert_near(slab_radiance(solution, fixture->optics, 1, SLAB_REFLECTED, INFINITY, 0.5, 0.7, 1),
		    slab_radiance(solution, fixture->optics, 1, SLAB_REFLECTED, 1e6, 0.5, 0.7, 1), 1e-4, "infinite layer");
}

static void check_extremes(const struct slab_solution *solution, const struct optics *optics)
{
	static const double mus[] = {0, 1e-300, 1e-6, 0.01, 0.5, 1, -1, 2, NAN},
			    depths[] = {0, 1e-300, 1e-6, 0.01, 1, 500, 1e9, INFINITY, NAN};
	static const double azimuths[] = {0, 1, M_PI, 1e6, INFINITY, NAN};
	for (size_t i = 0; i < sizeof mus / sizeof *mus; i++)
		for (size_t j = 0; j < sizeof mus / sizeof *mus; j++)
			for (size_t k = 0; k < sizeof depths / sizeof *depths; k++)
				for (size_t l = 0; l < sizeof azimuths / sizeof *azimuths; l++)
					for (int side = 0; side < SLAB_SIDE_COUNT; side++) {
						double value = slab_radiance(solution, optics, (int)(l % BAND_COUNT), side, depths[k],
									     mus[i], mus[j], azimuths[l]);
						assert_true(isfinite(value) && value >= 0 && value < 1e5);
					}
	for (size_t i = 0; i < sizeof mus / sizeof *mus; i++)
		for (size_t k = 0; k < sizeof depths / sizeof *depths; k++) {
			struct slab_flux flux = slab_flux_at(solution, 1, depths[k], mus[i]);
			assert_near(flux.reflected + flux.transmitted, 1, 5e-4, "R + T");
			flux = slab_flux_spherical(solution, 1, depths[k]);
			assert_near(flux.reflected + flux.transmitted, 1, 1e-4, "spherical R + T");
		}
}

static void extremes(void **state)
{
	struct fixture *fixture = *state;
	check_extremes(fixture->solution, fixture->optics);
	assert_true(slab_radiance(fixture->solution, fixture->optics, 1, SLAB_TRANSMITTED, 0, 0.5, 0.5, 0) == 0);
	assert_true(slab_radiance(fixture->solution, fixture->optics, 1, SLAB_REFLECTED, 1, 0, 0.5, 0) == 0);
	assert_true(slab_flux_at(fixture->solution, 1, 0, 0.5).transmitted == 1);
	/* The horizon is the limit of what is next to it. */
	for (int side = 0; side < SLAB_SIDE_COUNT; side++)
		assert_near(slab_radiance(fixture->solution, fixture->optics, 1, side, 1, 0.5, 0, 2) /
				    slab_radiance(fixture->solution, fixture->optics, 1, side, 1, 0.5, 1e-4, 2),
			    1, 0.02, "view at the horizon");
}

/* --- any droplets -------------------------------------------------------------------------------------------------------------- */

static void check_droplets(const struct kernel *kernel, const struct scene_dsd *dsd, double *worst_r)
{
	struct optics *optics = optics_create(kernel, dsd, OPTICS_MIE);
	assert_non_null(optics);
	struct slab_solution *solution = slab_solve(optics, 2);
	assert_non_null(solution);
	for (int band = 0; band < BAND_COUNT; band++) {
		check_conservation(solution, band);
		assert_near(solution->band[band].asymmetry, 0, 1e-6, "difference of transposed elements");
		assert_true(solution->band[band].truncated >= 0 && solution->band[band].truncated < 0.8);
		double tau = random_depth(), mu_l = random_unit();
		for (int phase = 0; phase < 2; phase++) {
			struct slab_orders orders = slab_orders_at(optics, band, phase, tau, mu_l);
			double sum = 0;
			for (int order = 0; order < 4; order++) {
				assert_true(orders.r[order] >= 0 && orders.t[order] >= 0);
				sum += orders.r[order] + orders.t[order];
			}
			assert_near(sum, 1, 1e-3, "sum of orders");
			double r = orders.r[1] + orders.r[2] + orders.r[3];
			double error = fabs(r - slab_flux_at(solution, band, tau, fmax(mu_l, 1e-3)).reflected);
			if (phase == SLAB_PHASE_FULL)
				assert_near(error, 0, 5e-4, "R of orders against R");
			else if (mu_l > 0.1) /* light that grazes notices the missing peak */
				*worst_r = fmax(*worst_r, error);
		}
	}
	for (int i = 0; i < 2000; i++) {
		double mu_l = random_unit(), mu_v = random_unit(), azimuth = 2 * M_PI * random_unit();
		double value = slab_radiance(solution, optics, i % BAND_COUNT, i / 3 % 2, random_depth(), mu_l, mu_v, azimuth);
		assert_true(isfinite(value) && value >= 0);
	}
	check_extremes(solution, optics);
	slab_destroy(solution);
	optics_destroy(optics);
}

static void any_droplets(void **state)
{
	struct fixture *fixture = *state;
	static const double corners[][2] = {{1, 1}, {1, 30}, {20, 1}, {20, 30}};
	const char *wanted = getenv("STRATUS_SLAB_DROPLETS");
	int count = wanted ? atoi(wanted) : 20;
	double worst = 0;
	for (int i = 0; i < count; i++) {
		struct scene_dsd dsd = {300, 1 + 19 * random_unit(), pow(30, random_unit())};
		if (i < 4)
			dsd = (struct scene_dsd){300, corners[i][0], corners[i][1]};
		check_droplets(fixture->kernel, &dsd, &worst);
	}
	print_message("%d distributions; R of the modified and the full phase function differ by up to %.4f\n", count, worst);
	assert_near(worst, 0, 0.02, "R of the modified phase function");
}

/* --- tables -------------------------------------------------------------------------------------------------------------------- */

static void slices(void **state)
{
	static const double ratio[BAND_COUNT] = {1.03, 1, 0.96};
	struct fixture *fixture = *state;
	struct slab_slice *slice = malloc(sizeof *slice);
	assert_non_null(slice);
	double square = 0, worst = 0;
	int count = 0;
	for (int i = 0; i < 40; i++) {
		double mu_l = 0.03 + 0.97 * random_unit();
		enum slab_side side = i % 2 ? SLAB_REFLECTED : SLAB_TRANSMITTED;
		slab_slice_fill(fixture->solution, side, mu_l, ratio, slice);
		for (int j = 0; j < 250; j++) {
			double tau = random_depth() * (j % 10 ? 1 : 20), mu_v = 0.03 + 0.97 * random_unit(),
			       azimuth = 2 * M_PI * random_unit();
			int band = j % BAND_COUNT;
			double table = slab_slice_radiance(fixture->solution, slice, band, tau, mu_v, azimuth);
			tau *= ratio[band];
			double exact = slab_radiance_multiple(fixture->solution, band, side, tau, mu_l, mu_v, azimuth);
			double single = slab_radiance_single(fixture->solution, fixture->optics, band, side, tau, mu_l, mu_v, azimuth);
			double error = fabs(table - exact) / (exact + single);
			square += error * error;
			worst = fmax(worst, error);
			count++;
		}
	}
	free(slice);
	print_message("slices: rms %.3f %%, worst %.2f %%\n", 100 * sqrt(square / count), 100 * worst);
	assert_near(sqrt(square / count), 0, 0.005, "rms");
	assert_near(worst, 0, 0.04, "worst");
}

/* Fluxes in a row, and the albedo alone, against one by one. */
static void flux_rows(void **state)
{
	struct fixture *fixture = *state;
	const double tau[] = {0, 1e-4, 0.02, 0.7, 9, 140, 551, 3000, 1e6};
	enum { COUNT = sizeof tau / sizeof *tau };
	for (int i = 0; i < 20; i++) {
		struct slab_flux row[COUNT];
		double mu = i / 19.0;
		slab_flux_row(fixture->solution, i % BAND_COUNT, mu, tau, COUNT, row);
		for (int k = 0; k < COUNT; k++) {
			struct slab_flux one = slab_flux_at(fixture->solution, i % BAND_COUNT, tau[k], mu);
			assert_near(row[k].reflected, one.reflected, 1e-12, "R in a row");
			assert_near(row[k].transmitted, one.transmitted, 1e-12, "T in a row");
			assert_near(row[k].reflected + row[k].transmitted, 1, 1e-3, "R + T");
			assert_near(slab_spherical_albedo(fixture->solution, i % BAND_COUNT, tau[k]),
				    slab_flux_spherical(fixture->solution, i % BAND_COUNT, tau[k]).reflected, 1e-12, "spherical albedo");
		}
	}
}

static void threads_agree(void **state)
{
	struct fixture *fixture = *state;
	static const int threads[] = {0, 1, 3, 1000};
	for (size_t i = 0; i < sizeof threads / sizeof *threads; i++) {
		struct slab_solution *other = slab_solve(fixture->optics, threads[i]);
		assert_non_null(other);
		assert_memory_equal(other, fixture->solution, sizeof *other);
		slab_destroy(other);
	}
	slab_destroy(NULL);
}

static int set_up(void **state)
{
	static struct fixture fixture;
	const char *path = getenv("STRATUS_KERNEL");
	fixture.kernel = kernel_load(path ? path : "build/mie.kernel");
	fixture.reference = json_load_file("tests/data/slab.json", JSON_REJECT_DUPLICATES, NULL);
	if (!fixture.kernel || !fixture.reference)
		return -1;
	fixture.optics = optics_create(fixture.kernel, &(struct scene_dsd){300, 2, 7}, OPTICS_MIE);
	fixture.solution = fixture.optics ? slab_solve(fixture.optics, 2) : NULL;
	*state = &fixture;
	return fixture.solution ? 0 : -1;
}

static int tear_down(void **state)
{
	struct fixture *fixture = *state;
	slab_destroy(fixture->solution);
	optics_destroy(fixture->optics);
	kernel_destroy(fixture->kernel);
	json_decref(fixture->reference);
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(reference_fluxes),
		cmocka_unit_test(reference_radiances),
		cmocka_unit_test(reference_orders),
		cmocka_unit_test(conservation),
		cmocka_unit_test(reciprocity),
		cmocka_unit_test(radiance_adds_up),
		cmocka_unit_test(zenith_has_no_azimuth),
		cmocka_unit_test(thin_layers_scatter_once),
		cmocka_unit_test(thick_layers),
		cmocka_unit_test(extremes),
		cmocka_unit_test(any_droplets),
		cmocka_unit_test(slices),
		cmocka_unit_test(flux_rows),
		cmocka_unit_test(threads_agree),
	};
	return cmocka_run_group_tests(tests, set_up, tear_down);
}
