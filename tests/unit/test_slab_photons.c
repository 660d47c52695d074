/* The photon tracer, and the solved slab against it. Wants build/mie.kernel, or the file that STRATUS_KERNEL names. All seeds are fixed, so
 * that what passes once always passes. */
#include "renderer/optics/kernel.h"
#include "renderer/optics/photon_phase.h"
#include "renderer/optics/quadrature.h"
#include "renderer/optics/slab_photons.h"
#include "tests/unit/numbers.h"

#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <cmocka.h>

#define DEGREE (M_PI / 180)

enum { DROPLETS = 4, VIEWS = 6, AZIMUTHS = 5, DIRECTIONS = SLAB_SIDE_COUNT * VIEWS * AZIMUTHS };

/* The reference's droplets first, then others that differ as much as droplets may. */
static const double droplets[DROPLETS][2] = {{2, 7}, {1, 1}, {1, 30}, {20, 15}};

struct fixture {
	struct kernel *kernel;
	struct optics *optics[DROPLETS];
	json_t *reference;
};

/* Those of the reference's radiances. */
static const double zenith_deg[VIEWS] = {0, 15, 30, 45, 60, 75}, azimuth_deg[AZIMUTHS] = {0, 45, 90, 135, 180};
static double views[VIEWS], azimuths[AZIMUTHS];

static struct photon_params params_for(const struct optics *optics, double tau, double sun_deg, uint64_t photons)
{
	return (struct photon_params){
		.optics = optics, .band = 1, .tau = tau, .mu_l = cos(sun_deg * DEGREE), .photons = photons, .seed = 1, .threads = 2};
}

static void add_directions(struct photon_params *params)
{
	params->view_count = VIEWS;
	params->azimuth_count = AZIMUTHS;
	params->mu_v = views;
	params->azimuth = azimuths;
}

static struct photon_result trace(const struct photon_params *params)
{
	struct photon_result result;
	assert_true(slab_photons_trace(params, &result));
	return result;
}

/* Scattering angle between the sun's light and that towards a view. */
static double scattering_angle(enum slab_side side, double mu_l, double mu_v, double azimuth)
{
	double along = side == SLAB_TRANSMITTED ? mu_l * mu_v : -mu_l * mu_v;
	return acos(fmin(fmax(along + sqrt((1 - mu_l * mu_l) * (1 - mu_v * mu_v)) * cos(azimuth), -1), 1));
}

/* --- what photons draw --------------------------------------------------------------------------------------------------------- */

enum { CELLS = 90 };

/* Limits of cells in angle: even steps of the square root, so that the forward peak has many. */
static double cell_angle(int cell)
{
	double t = (double)cell / CELLS;
	return M_PI * t * t;
}

/* Integrals of P over the cells, by Simpson's rule over the angle. */
static void integrate_cells(const struct optics *optics, int band, double share[CELLS])
{
	enum { STEPS = 64 };
	for (int cell = 0; cell < CELLS; cell++) {
		double low = cell_angle(cell), step = (cell_angle(cell + 1) - low) / STEPS;
		share[cell] = 0;
		for (int i = 0; i <= STEPS; i++) {
			double weight = i == 0 || i == STEPS ? 1 : i % 2 ? 4 : 2, angle = low + i * step;
			share[cell] += weight * step / 6 * sin(angle) * optics_phase(optics, band, angle);
		}
	}
}

static void check_angles(const struct optics *optics, int band, struct photon_phase *phase)
{
	enum { DRAWS = 400000 };
	struct photon_random random;
	double share[CELLS], mean = 0, chi_square = 0;
	int seen[CELLS] = {0}, peak = 0, used = 0;
	integrate_cells(optics, band, share);
	photon_phase_fill(phase, optics, band, SLAB_PHASE_FULL);
	photon_random_start(&random, 11, (uint64_t)band);
	for (int i = 0; i < DRAWS; i++) {
		struct photon_angle angle = photon_phase_draw(phase, &random);
		double theta = atan2(angle.sine, angle.cosine);
		assert_true(angle.peak == (theta < FORWARD_PEAK_ANGLE));
		assert_near(hypot(angle.sine, angle.cosine), 1, 1e-12, "length");
		seen[(int)(CELLS * sqrt(theta / M_PI))]++;
		mean += angle.cosine / DRAWS;
		peak += angle.peak;
	}
	for (int cell = 0; cell < CELLS; cell++) {
		double expected = DRAWS * share[cell];
		if (expected < 10)
			continue;
		chi_square += (seen[cell] - expected) * (seen[cell] - expected) / expected;
		used++;
	}
	double fraction = optics->forward_peak_fraction[band];
	assert_true(used > 70);
	assert_near(chi_square, used, 4 * sqrt(2 * used), "chi square of the angles");
	assert_near(mean, optics->asymmetry[band], 4 * 0.5 / sqrt(DRAWS), "g");
	assert_near((double)peak / DRAWS, fraction, 4 * sqrt(fraction * (1 - fraction) / DRAWS), "P_f");
}

static void angles_follow_the_phase_function(void **state)
{
	struct fixture *fixture = *state;
	struct photon_phase *phase = malloc(sizeof *phase);
	assert_non_null(phase);
	for (int i = 0; i < DROPLETS; i++)
		check_angles(fixture->optics[i], i % BAND_COUNT, phase);
	/* Nothing inside the peak of P_S, whose asymmetry is its first moment. */
	struct photon_random random;
	double mean = 0;
	photon_random_start(&random, 12, 0);
	photon_phase_fill(phase, fixture->optics[0], 1, SLAB_PHASE_MODIFIED);
	for (int i = 0; i < 200000; i++) {
		struct photon_angle angle = photon_phase_draw(phase, &random);
		assert_true(!angle.peak && angle.cosine <= cos(FORWARD_PEAK_ANGLE) + 1e-12);
		mean += angle.cosine / 200000;
	}
	assert_near(mean, fixture->optics[0]->moment_modified[1][1], 4 * 0.6 / sqrt(200000), "g of P_S");
	free(phase);
}

/* What the local estimate looks up is the density that angles are drawn from: the same numbers, in single precision. */
static void looked_up_is_drawn(void **state)
{
	struct fixture *fixture = *state;
	struct photon_phase *phase = malloc(sizeof *phase);
	assert_non_null(phase);
	for (int i = 0; i < DROPLETS; i++) {
		photon_phase_fill(phase, fixture->optics[i], 2, SLAB_PHASE_FULL);
		for (int zone = 0; zone < PHOTON_ZONE_COUNT; zone++) {
			static const int first[] = {0, PHOTON_BODY_FRONT, PHOTON_BODY_BACK};
			const struct photon_line *line = zone == PHOTON_PEAK ? phase->peak : &phase->body[first[zone]];
			for (int bin = 0; bin < PHOTON_ZONE_BINS; bin++) {
				double low = pow(phase->start[zone] + bin * phase->step[zone], 2);
				double high = pow(phase->start[zone] + (bin + 1) * phase->step[zone], 2);
				double mean = line[bin].offset + line[bin].slope * (low + high) / 2;
				int index = zone * PHOTON_ZONE_BINS + bin;
				double density = (phase->below[index + 1] - phase->below[index]) / (high - low);
				assert_near(mean / density, 1, 1e-4, "density");
				double angle = 2 * asin(sqrt((low + high) / 2));
				double p = optics_phase(fixture->optics[i], 2, zone == PHOTON_BACK ? M_PI - angle : angle);
				assert_near(mean / p, 1, 0.002, "P");
			}
		}
	}
	free(phase);
}

static void directions_turn_evenly(void **state)
{
	(void)state;
	enum { TURNS = 200000, SECTORS = 16 };
	struct photon_random random;
	struct photon_angle angle = {.cosine = cos(0.7), .sine = sin(0.7)};
	double direction[3] = {0, 0, -1};
	int seen[SECTORS] = {0};
	photon_random_start(&random, 3, 3);
	for (int i = 0; i < TURNS; i++) {
		double before[3] = {direction[0], direction[1], direction[2]};
		photon_turn(direction, angle, &random);
		double dot = 0, length = 0;
		for (int k = 0; k < 3; k++) {
			dot += before[k] * direction[k];
			length += direction[k] * direction[k];
		}
		assert_near(dot, angle.cosine, 1e-12, "cosine of the turn");
		assert_near(length, 1, 1e-12, "length");
		/* Angle about the direction, from the plane that holds it and the vertical. */
		double across = before[0] * direction[1] - before[1] * direction[0], up = direction[2] - before[2] * angle.cosine;
		seen[(int)((atan2(across, up) / (2 * M_PI) + 0.5) * SECTORS) % SECTORS]++;
	}
	double chi_square = 0, expected = (double)TURNS / SECTORS;
	for (int i = 0; i < SECTORS; i++)
		chi_square += (seen[i] - expected) * (seen[i] - expected) / expected;
	assert_near(chi_square, SECTORS - 1, 4 * sqrt(2.0 * SECTORS), "chi square of the azimuth");
}

/* --- against other programs and closed forms ----------------------------------------------------------------------------------- */

static void reference_orders(void **state)
{
	static const char *const names[2][4] = {{"", "R1", "R2", "R3plus"}, {"T0", "T1", "T2", "T3plus"}};
	struct fixture *fixture = *state;
	size_t i;
	json_t *row;
	json_array_foreach(json_object_get(json_object_get(fixture->reference, "orders_of_scattering"), "rows"), i, row)
	{
		bool full = strcmp(json_string_value(json_object_get(row, "phase")), "full") == 0;
		double share = full ? 1 : 1 - fixture->optics[0]->forward_peak_fraction[1];
		struct photon_params params = params_for(fixture->optics[0], number(row, "tau_vertical") / share, 30, 150000);
		params.phase = full ? SLAB_PHASE_FULL : SLAB_PHASE_MODIFIED;
		struct photon_result result = trace(&params);
		for (int order = 0; order < 4; order++) {
			double other = number(row, "stderr_max");
			double error_r = hypot(result.orders_error.r[order], other), error_t = hypot(result.orders_error.t[order], other);
			if (order > 0)
				assert_near(result.orders.r[order], number(row, names[0][order]), 4 * error_r, names[0][order]);
			assert_near(result.orders.t[order], number(row, names[1][order]), 4 * error_t, names[1][order]);
		}
		assert_null(result.radiance);
		photon_result_finish(&result);
	}
	assert_int_equal(i, 6);
}

static void reference_fluxes(void **state)
{
	struct fixture *fixture = *state;
	size_t i;
	json_t *row;
	json_array_foreach(json_object_get(json_object_get(fixture->reference, "fluxes"), "rows"), i, row)
	{
		struct photon_params params = params_for(fixture->optics[0], element(row, 0), element(row, 1), 50000);
		struct photon_result result = trace(&params);
		assert_near(result.flux.reflected, element(row, 2), 4 * result.flux_error.reflected, "R");
		assert_near(result.flux.transmitted, element(row, 3) + element(row, 4), 4 * result.flux_error.transmitted, "T");
		assert_near(result.flux.direct, element(row, 4), 1e-9, "T, direct");
		assert_true(result.flux_error.reflected < 0.0025);
		photon_result_finish(&result);
	}
	assert_true(i >= 8);
}

/* Discrete ordinates with 256 streams are some 0.5 % off themselves where P is steep. */
static void reference_radiances(void **state)
{
	struct fixture *fixture = *state;
	size_t i;
	json_t *entry;
	double square = 0;
	int count = 0;
	json_array_foreach(json_object_get(json_object_get(fixture->reference, "radiances"), "cases"), i, entry)
	{
		const json_t *rows[] = {json_object_get(entry, "reflected_rows_viewzenith_cols_azimuth"),
					json_object_get(entry, "transmitted_diffuse_rows_viewzenith_cols_azimuth")};
		struct photon_params params = params_for(fixture->optics[0], number(entry, "tau"), number(entry, "sun_zenith_deg"), 100000);
		add_directions(&params);
		struct photon_result result = trace(&params);
		for (int k = 0; k < DIRECTIONS; k++) {
			const json_t *row = json_array_get(rows[k / (VIEWS * AZIMUTHS)], (size_t)(k / AZIMUTHS % VIEWS));
			double expected = element(row, (size_t)(k % AZIMUTHS)), error = result.radiance_error[k] + 0.002 * expected;
			assert_near(result.radiance[k], expected, 4 * error, "radiance");
			square += pow((result.radiance[k] - expected) / error, 2);
			count++;
		}
		photon_result_finish(&result);
	}
	assert_int_equal(count, 3 * DIRECTIONS);
	assert_near(sqrt(square / count), 0.75, 0.4, "rms in standard errors");
}

static void thin_layers_scatter_once(void **state)
{
	struct fixture *fixture = *state;
	for (int i = 0; i < DROPLETS; i++) {
		double tau = 1e-4;
		struct photon_params params = params_for(fixture->optics[i], tau, 40, 20000);
		add_directions(&params);
		struct photon_result result = trace(&params);
		for (int k = 0; k < DIRECTIONS; k++) {
			double mu_v = views[k / AZIMUTHS % VIEWS];
			double angle = scattering_angle(k / (VIEWS * AZIMUTHS), params.mu_l, mu_v, azimuths[k % AZIMUTHS]);
			double expected = optics_phase(fixture->optics[i], 1, angle) / (4 * M_PI) * tau / mu_v;
			/* Higher orders, most in the aureole's flanks and where P has its least. */
			assert_near(result.radiance[k] / expected, 1, 0.003 + 40 * tau + 4 * result.radiance_error[k] / expected,
				    "single scattering");
			assert_true(result.radiance_error[k] < 0.02 * expected);
		}
		assert_near(result.orders.t[0], exp(-tau / params.mu_l), 1e-12, "T_0");
		photon_result_finish(&result);
	}
}

/* --- what must hold for every layer -------------------------------------------------------------------------------------------- */

static void counts_add_up(void **state)
{
	struct fixture *fixture = *state;
	static const double depths[] = {1e-9, 0.01, 1, 30, 300};
	for (size_t i = 0; i < sizeof depths / sizeof *depths; i++)
		for (int phase = 0; phase < 2; phase++) {
			struct photon_params params = params_for(fixture->optics[i % DROPLETS], depths[i], 70, 2001);
			params.phase = phase;
			struct photon_result result = trace(&params);
			double sum = result.orders.t[0], reflected = 0;
			for (int order = 1; order < 4; order++) {
				sum += result.orders.r[order] + result.orders.t[order];
				reflected += result.orders.r[order];
			}
			assert_near(sum, 1, 1e-14, "sum of orders");
			assert_near(result.flux.reflected + result.flux.transmitted, 1, 1e-14, "R + T");
			assert_near(result.flux.reflected, reflected, 1e-14, "R");
			assert_true(result.scatterings >= params.photons);
			photon_result_finish(&result);
		}
}

/* Radiance over the hemisphere is the flux that was counted. The transmitted one is too steep for a quadrature. */
static void radiance_adds_up(void **state)
{
	enum { NODES = 16, TURNS = 16 };
	struct fixture *fixture = *state;
	double mu[NODES], weight[NODES], azimuth[TURNS];
	quadrature_gauss(NODES, mu, weight);
	for (int i = 0; i < TURNS; i++)
		azimuth[i] = (i + 0.5) * M_PI / TURNS;
	for (int i = 0; i < DROPLETS; i++) {
		struct photon_params params = params_for(fixture->optics[i], 5, 20 * i, 30000);
		params.view_count = NODES;
		params.azimuth_count = TURNS;
		params.mu_v = mu;
		params.azimuth = azimuth;
		struct photon_result result = trace(&params);
		double sum = 0;
		for (int k = 0; k < NODES * TURNS; k++)
			sum += 2 * M_PI / TURNS * weight[k / TURNS] * mu[k / TURNS] * result.radiance[k];
		assert_near(sum / params.mu_l, result.flux.reflected, 4 * result.flux_error.reflected, "reflected radiance");
		photon_result_finish(&result);
	}
}

static void assert_same(const struct photon_result *a, const struct photon_result *b)
{
	assert_memory_equal(&a->orders, &b->orders, sizeof a->orders);
	assert_memory_equal(&a->orders_error, &b->orders_error, sizeof a->orders_error);
	assert_memory_equal(&a->flux, &b->flux, sizeof a->flux);
	assert_memory_equal(&a->flux_error, &b->flux_error, sizeof a->flux_error);
	assert_memory_equal(a->radiance, b->radiance, DIRECTIONS * sizeof *a->radiance);
	assert_memory_equal(a->radiance_error, b->radiance_error, DIRECTIONS * sizeof *a->radiance_error);
	assert_int_equal(a->scatterings, b->scatterings);
}

static void threads_agree(void **state)
{
	struct fixture *fixture = *state;
	static const int threads[] = {1, 2, 3, 16, 0, 1000};
	static const uint64_t photons[] = {1, 7, 5003};
	for (size_t k = 0; k < sizeof photons / sizeof *photons; k++) {
		struct photon_params params = params_for(fixture->optics[0], 3, 50, photons[k]);
		add_directions(&params);
		struct photon_result first = trace(&params);
		for (size_t i = 0; i < sizeof threads / sizeof *threads; i++) {
			params.threads = threads[i];
			struct photon_result again = trace(&params);
			assert_same(&first, &again);
			photon_result_finish(&again);
		}
		params.seed = 2;
		struct photon_result other = trace(&params);
		assert_memory_not_equal(first.radiance, other.radiance, DIRECTIONS * sizeof *first.radiance);
		photon_result_finish(&other);
		photon_result_finish(&first);
	}
}

static void check_radiance_orders(const struct optics *optics, enum slab_phase phase, double tau, double sun_deg)
{
	enum { ORDERS = 5 };
	struct photon_params params = params_for(optics, tau, sun_deg, 40000);
	add_directions(&params);
	params.phase = phase;
	struct photon_result plain = trace(&params);
	assert_null(plain.radiance_orders);
	params.order_count = ORDERS;
	struct photon_result result = trace(&params);
	assert_int_equal(result.scatterings, plain.scatterings);
	const double left = 1 - optics->forward_peak_fraction[1], share = phase == SLAB_PHASE_FULL ? 1 : left;
	for (int k = 0; k < DIRECTIONS; k++) {
		const enum slab_side side = k / (VIEWS * AZIMUTHS);
		const double mu_v = views[k / AZIMUTHS % VIEWS], mu_l = params.mu_l;
		double sum = 0;
		for (int order = 0; order < ORDERS; order++)
			sum += result.radiance_orders[order * DIRECTIONS + k];
		assert_near(sum, result.radiance[k], 1e-5 * sum, "sum of orders");
		assert_near(result.radiance[k], plain.radiance[k], 1e-5 * sum, "radiance");
		/* The first is known. */
		const double angle = scattering_angle(side, mu_l, mu_v, azimuths[k % AZIMUTHS]);
		const double p = angle < FORWARD_PEAK_ANGLE && phase == SLAB_PHASE_MODIFIED ? 0 : optics_phase(optics, 1, angle) / share;
		const double a = share * tau / mu_l, b = share * tau / mu_v;
		const double column = side == SLAB_REFLECTED ? mu_l / (mu_l + mu_v) * -expm1(-a - b)
				      : fabs(a - b) < 1e-9   ? a * exp(-a)
							     : mu_l / (mu_l - mu_v) * (exp(-a) - exp(-b));
		const double expected = p / (4 * M_PI) * column, error = 5 * result.radiance_error[k] + 1e-3 * expected;
		assert_near(result.radiance_orders[k], expected, error, "first order");
	}
	photon_result_finish(&plain);
	photon_result_finish(&result);
}

static void radiance_by_orders(void **state)
{
	struct fixture *fixture = *state;
	check_radiance_orders(fixture->optics[0], SLAB_PHASE_FULL, 0.8, 50);
	check_radiance_orders(fixture->optics[0], SLAB_PHASE_MODIFIED, 2, 72);
	check_radiance_orders(fixture->optics[2], SLAB_PHASE_FULL, 3, 20);
}

/* --- standard errors ----------------------------------------------------------------------------------------------------------- */

/* Spread over seeds against what each of them reported: the mean over directions of the ratio of variances. */
static void check_errors(const struct optics *optics, double tau, double sun_deg, uint64_t photons)
{
	enum { SEEDS = 40 };
	static double mean[DIRECTIONS], square[DIRECTIONS], reported[DIRECTIONS];
	double flux = 0, flux_square = 0, flux_reported = 0, ratio = 0;
	memset(mean, 0, sizeof mean);
	memset(square, 0, sizeof square);
	memset(reported, 0, sizeof reported);
	struct photon_params params = params_for(optics, tau, sun_deg, photons);
	add_directions(&params);
	for (int seed = 0; seed < SEEDS; seed++) {
		params.seed = 1000 + (uint64_t)seed;
		struct photon_result result = trace(&params);
		for (int k = 0; k < DIRECTIONS; k++) {
			mean[k] += result.radiance[k] / SEEDS;
			square[k] += result.radiance[k] * result.radiance[k] / SEEDS;
			reported[k] += result.radiance_error[k] * result.radiance_error[k] / SEEDS;
		}
		flux += result.flux.reflected / SEEDS;
		flux_square += result.flux.reflected * result.flux.reflected / SEEDS;
		flux_reported += result.flux_error.reflected * result.flux_error.reflected / SEEDS;
		photon_result_finish(&result);
	}
	for (int k = 0; k < DIRECTIONS; k++) {
		double one = (square[k] - mean[k] * mean[k]) * SEEDS / (SEEDS - 1) / reported[k];
		assert_true(one > 0.3 && one < 2.5); /* 0.22 either way for each */
		ratio += one / DIRECTIONS;
	}
	print_message("tau %g, sun at %g: variance over seeds is %.2f of what was reported\n", tau, sun_deg, ratio);
	assert_near(ratio, 1, 0.3, "variance of radiance");
	assert_near((flux_square - flux * flux) * SEEDS / (SEEDS - 1) / flux_reported, 1, 0.9, "variance of flux");
}

static void errors_are_honest(void **state)
{
	struct fixture *fixture = *state;
	check_errors(fixture->optics[0], 0.5, 60, 2000);
	check_errors(fixture->optics[2], 8, 30, 1000);
	check_errors(fixture->optics[1], 2, 80, 1000);
}

/* --- the solved slab ----------------------------------------------------------------------------------------------------------- */

static double random_unit(void)
{
	static uint64_t state = 7;
	state = state * 6364136223846793005ULL + 1442695040888963407ULL;
	return (double)(state >> 11) * 0x1p-53;
}

/* Values within max(3 standard errors, 2 %) and all. */
struct tally {
	int within, all;
	double worst; /* over what is allowed */
	char where[256];
};

static void count(struct tally *tally, double value, double judge, double error, const char *where)
{
	double off = fabs(value - judge), allowed = fmax(3 * error, 0.02 * judge);
	tally->all++;
	tally->within += off <= allowed;
	if (off / allowed > tally->worst) {
		tally->worst = off / allowed;
		snprintf(tally->where, sizeof tally->where, "%.4g instead of %.4g +- %.2g %s", value, judge, error, where);
	}
}

static void print_tally(const struct tally *tally, const char *what)
{
	print_message("%s: %d of %d within max(3 standard errors, 2 %%); worst %.2f of that: %s\n", what, tally->within, tally->all,
		      tally->worst, tally->where);
}

static void judge_layer(const struct fixture *fixture, int i, const struct slab_solution *solution, int band, struct tally *fluxes,
			struct tally *radiances)
{
	const struct optics *optics = fixture->optics[i];
	double tau = 0.1 * pow(1000, random_unit());
	struct photon_params params = params_for(optics, tau, 85 * random_unit(), tau < 10 ? 30000 : 10000);
	params.band = band;
	add_directions(&params);
	struct photon_result result = trace(&params);
	struct slab_flux flux = slab_flux_at(solution, band, tau, params.mu_l);
	char where[128];
	int used = snprintf(where, sizeof where, "at gamma %g, re %g, band %d, tau %.3g, sun at %.1f", droplets[i][0], droplets[i][1], band,
			    tau, acos(params.mu_l) / DEGREE);
	count(fluxes, flux.reflected, result.flux.reflected, result.flux_error.reflected, where);
	count(fluxes, flux.transmitted, result.flux.transmitted, result.flux_error.transmitted, where);
	for (int k = 0; k < DIRECTIONS; k++) {
		enum slab_side side = k / (VIEWS * AZIMUTHS);
		double mu_v = views[k / AZIMUTHS % VIEWS], azimuth = azimuths[k % AZIMUTHS];
		if (scattering_angle(side, params.mu_l, mu_v, azimuth) < 3 * DEGREE)
			continue;
		double value = slab_radiance(solution, optics, band, side, tau, params.mu_l, mu_v, azimuth);
		snprintf(where + used, sizeof where - (size_t)used, ", side %d, view at %g, %g", side, zenith_deg[k / AZIMUTHS % VIEWS],
			 azimuth_deg[k % AZIMUTHS]);
		count(radiances, value, result.radiance[k], result.radiance_error[k], where);
	}
	photon_result_finish(&result);
}

static void judges_the_solved_slab(void **state)
{
	struct fixture *fixture = *state;
	struct tally fluxes = {0}, radiances = {0};
	for (int i = 0; i < DROPLETS; i++) {
		struct slab_solution *solution = slab_solve(fixture->optics[i], 2);
		assert_non_null(solution);
		for (int k = 0; k < 9; k++)
			judge_layer(fixture, i, solution, k % BAND_COUNT, &fluxes, &radiances);
		slab_destroy(solution);
	}
	print_tally(&fluxes, "fluxes");
	print_tally(&radiances, "radiances");
	assert_true(fluxes.within == fluxes.all);
	assert_true(radiances.all > 2000 && radiances.within >= 0.99 * radiances.all);
}

/* Nodes over the cone of 3 degrees about the beam: flux within it, direct light apart. */
enum { RINGS = 6, SPOKES = 4 };

struct cone {
	double weight[RINGS], mu[RINGS][SPOKES], azimuth[RINGS][SPOKES];
};

static void cone_init(struct cone *cone, double zenith)
{
	double node[RINGS], weight[RINGS];
	quadrature_gauss(RINGS, node, weight);
	for (int i = 0; i < RINGS; i++) {
		double angle = 3 * DEGREE * node[i] * node[i]; /* dense in the middle */
		cone->weight[i] = 2 * M_PI * sin(angle) * 6 * DEGREE * node[i] * weight[i];
		for (int k = 0; k < SPOKES; k++) {
			double turn = (k + 0.5) * M_PI / SPOKES, along = sin(angle) * cos(turn);
			double x = sin(zenith) * cos(angle) + along * cos(zenith), y = sin(angle) * sin(turn);
			cone->mu[i][k] = cos(zenith) * cos(angle) - along * sin(zenith);
			cone->azimuth[i][k] = atan2(y, x);
		}
	}
}

static void check_aureole(const struct optics *optics, const struct slab_solution *solution, double tau, double sun_deg)
{
	struct cone cone;
	double solved = 0, traced = 0, variance = 0;
	cone_init(&cone, sun_deg * DEGREE);
	struct photon_params params = params_for(optics, tau, sun_deg, tau < 1 ? 3000 : 10000);
	params.view_count = params.azimuth_count = 1;
	for (int i = 0; i < RINGS; i++)
		for (int k = 0; k < SPOKES; k++) {
			params.mu_v = &cone.mu[i][k];
			params.azimuth = &cone.azimuth[i][k];
			params.seed = (uint64_t)(i * SPOKES + k);
			struct photon_result result = trace(&params);
			double weight = cone.weight[i] / SPOKES;
			solved += weight * slab_radiance(solution, optics, params.band, SLAB_TRANSMITTED, tau, params.mu_l, *params.mu_v,
							 *params.azimuth);
			traced += weight * result.radiance[SLAB_TRANSMITTED];
			variance += pow(weight * result.radiance_error[SLAB_TRANSMITTED], 2);
			photon_result_finish(&result);
		}
	assert_true(sqrt(variance) < 0.01 * traced);
	print_message("within 3 degrees: tau %g, sun at %g: solved %+.2f %%, standard error %.2f %%\n", tau, sun_deg,
		      100 * (solved / traced - 1), 100 * sqrt(variance) / traced);
	assert_near(solved / traced, 1, 0.03, "flux within 3 degrees");
}

static void judges_the_aureole(void **state)
{
	struct fixture *fixture = *state;
	for (int i = 0; i < DROPLETS; i++) {
		struct slab_solution *solution = slab_solve(fixture->optics[i], 2);
		assert_non_null(solution);
		check_aureole(fixture->optics[i], solution, 0.3, 60);
		check_aureole(fixture->optics[i], solution, 3, 30);
		slab_destroy(solution);
	}
}

/* --- limits -------------------------------------------------------------------------------------------------------------------- */

static void extremes(void **state)
{
	struct fixture *fixture = *state;
	static const double mus[] = {0, 1e-300, 1e-3, 1}, depths[] = {1e-300, 1e-6, 1, 2000};
	static const double azimuth[] = {0, 1, M_PI, -1e6, INFINITY};
	for (size_t i = 0; i < 4; i++)
		for (size_t k = 0; k < 4; k++)
			for (uint64_t photons = 1; photons < 100; photons += 69) {
				struct photon_params params = params_for(fixture->optics[k], depths[k], 0, photons);
				params.mu_l = mus[i];
				params.view_count = 4;
				params.azimuth_count = 5;
				params.mu_v = mus;
				params.azimuth = azimuth;
				struct photon_result result = trace(&params);
				for (int j = 0; j < SLAB_SIDE_COUNT * 4 * 5; j++) {
					assert_true(isfinite(result.radiance[j]) && result.radiance[j] >= 0);
					assert_true(isfinite(result.radiance_error[j]) && result.radiance_error[j] >= 0);
				}
				assert_near(result.flux.reflected + result.flux.transmitted, 1, 1e-14, "R + T");
				assert_true(result.flux_error.reflected >= 0 && result.flux_error.reflected < 0.5);
				photon_result_finish(&result);
			}
	photon_result_finish(NULL);
}

/* Says stop at the given question; keeps the longest processor time between two of them. */
struct question {
	atomic_int asked;
	int stop_at;
	double last_s, longest_s;
};

static double thread_time_s(void)
{
	struct timespec now;
	clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
	return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static bool ask(void *context)
{
	struct question *question = context;
	double now = thread_time_s();
	if (question->last_s > 0)
		question->longest_s = fmax(question->longest_s, now - question->last_s);
	question->last_s = now;
	return ++question->asked >= question->stop_at;
}

static bool stop_at_once(void *context)
{
	atomic_int *asked = context;
	++*asked;
	return true;
}

static void cancelled_soon(void **state)
{
	enum { MANY = 90 };
	struct fixture *fixture = *state;
	static double mu[MANY], azimuth[MANY];
	for (int i = 0; i < MANY; i++) {
		mu[i] = (i + 1.0) / MANY;
		azimuth[i] = i * M_PI / MANY;
	}
	struct photon_result result;
	for (int many = 0; many < 2; many++) {
		struct question question = {.stop_at = 30};
		struct photon_params params = params_for(fixture->optics[0], many ? 500 : 15000, 30, UINT64_MAX / 2);
		params.threads = 1;
		if (many) {
			params.view_count = params.azimuth_count = MANY;
			params.mu_v = mu;
			params.azimuth = azimuth;
		}
		params.cancelled = ask;
		params.cancel_context = &question;
		assert_false(slab_photons_trace(&params, &result));
		assert_null(result.radiance);
		assert_int_equal(question.asked, 30);
		assert_true(question.longest_s < 0.02);
		/* And no thread goes on when another was told to stop. */
		atomic_int asked = 0;
		params.threads = 3;
		params.cancelled = stop_at_once;
		params.cancel_context = &asked;
		assert_false(slab_photons_trace(&params, &result));
		assert_true(asked >= 1 && asked <= 3);
	}
}

static int set_up(void **state)
{
	static struct fixture fixture;
	const char *path = getenv("STRATUS_KERNEL");
	fixture.kernel = kernel_load(path ? path : "build/mie.kernel");
	fixture.reference = json_load_file("tests/data/slab.json", JSON_REJECT_DUPLICATES, NULL);
	if (!fixture.kernel || !fixture.reference)
		return -1;
	for (int i = 0; i < DROPLETS; i++) {
		fixture.optics[i] = optics_create(fixture.kernel, &(struct scene_dsd){10, droplets[i][0], droplets[i][1]}, OPTICS_MIE);
		if (!fixture.optics[i])
			return -1;
	}
	for (int i = 0; i < VIEWS; i++)
		views[i] = cos(zenith_deg[i] * DEGREE);
	for (int i = 0; i < AZIMUTHS; i++)
		azimuths[i] = azimuth_deg[i] * DEGREE;
	*state = &fixture;
	return 0;
}

static int tear_down(void **state)
{
	struct fixture *fixture = *state;
	for (int i = 0; i < DROPLETS; i++)
		optics_destroy(fixture->optics[i]);
	kernel_destroy(fixture->kernel);
	json_decref(fixture->reference);
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(angles_follow_the_phase_function),
		cmocka_unit_test(looked_up_is_drawn),
		cmocka_unit_test(directions_turn_evenly),
		cmocka_unit_test(reference_orders),
		cmocka_unit_test(reference_fluxes),
		cmocka_unit_test(reference_radiances),
		cmocka_unit_test(thin_layers_scatter_once),
		cmocka_unit_test(counts_add_up),
		cmocka_unit_test(radiance_adds_up),
		cmocka_unit_test(radiance_by_orders),
		cmocka_unit_test(threads_agree),
		cmocka_unit_test(errors_are_honest),
		cmocka_unit_test(judges_the_solved_slab),
		cmocka_unit_test(judges_the_aureole),
		cmocka_unit_test(extremes),
		cmocka_unit_test(cancelled_soon),
	};
	return cmocka_run_group_tests(tests, set_up, tear_down);
}
