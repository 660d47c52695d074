/* The paper's slab fitted to any droplets. Wants build/mie.kernel, or the file that STRATUS_KERNEL names. */
#include "renderer/log.h"
#include "renderer/optics/kernel.h"
#include "renderer/optics/paper_fit.h"
#include "renderer/optics/paper_fit_solve.h"
#include "tests/unit/numbers.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define DEGREE (M_PI / 180)

enum { BAND = 1, LAST = PAPER_FIT_ROWS - 1 };

/* The paper's droplets, solved and fitted once for all tests. */
struct fixture {
	struct kernel *kernel;
	struct optics *optics;
	struct slab_solution *solution;
	struct paper_fit_table table;
};

/* 0..1, the same in every run. */
static double random_unit(void)
{
	static uint64_t state = 11;
	state = state * 6364136223846793005ULL + 1442695040888963407ULL;
	return (double)(state >> 11) * 0x1p-53;
}

static void fit_values(const struct paper_fit *fit, double values[6])
{
	const double all[] = {fit->b, fit->c, fit->kappa_c, fit->t, fit->r, fit->beta};
	memcpy(values, all, sizeof all);
}

/* --- tables -------------------------------------------------------------------------------------------------------------------- */

/* Appendix B as printed: degrees, b, c, kappa_c, t, r. */
static const double printed[PAPER_FIT_ROWS][6] = {
	{0, 1.1796, 0.0138, 0.0265, 0.8389, 0.0547},  {10, 1.1293, 0.0154, 0.0262, 0.8412, 0.0547},
	{20, 1.1382, 0.0131, 0.0272, 0.8334, 0.0552}, {30, 1.0953, 0.0049, 0.0294, 0.8208, 0.0564},
	{40, 0.9808, 0.0012, 0.0326, 0.8010, 0.0603}, {50, 0.9077, 0.0047, 0.0379, 0.7774, 0.0705},
	{60, 0.7987, 0.0207, 0.0471, 0.7506, 0.0984}, {70, 0.6629, 0.0133, 0.0616, 0.7165, 0.1700},
	{80, 0.5043, 0.0280, 0.0700, 0.7149, 0.3554}, {90, 0.3021, 0.0783, 0.0700, 0.1000, 0.9500}};

static void rows_as_printed(void **state)
{
	(void)state;
	const struct paper_fit_table table = paper_fit_table_published();
	for (int row = 0; row < PAPER_FIT_ROWS; row++) {
		double values[6];
		struct paper_fit fit = paper_fit_table_at(&table, printed[row][0] * DEGREE);
		fit_values(&fit, values);
		assert_float_equal(fit.beta, 0.9961, 1e-12);
		for (int i = 0; i < 5; i++)
			assert_float_equal(values[i], printed[row][i + 1], 1e-9);
	}
}

/* Between rows the values stay between them, and neither they nor their slopes jump. */
static void check_interpolation(const struct paper_fit_table *table)
{
	double before[6], slope_before[6];
	for (int step = 0; step <= 9000; step++) {
		double degrees = step / 100.0, values[6], low[6], high[6];
		int row = 0;
		while (row < LAST - 1 && degrees > table->zenith_deg[row + 1])
			row++;
		struct paper_fit fit = paper_fit_table_at(table, degrees * DEGREE);
		fit_values(&fit, values);
		fit_values(&table->row[row], low);
		fit_values(&table->row[row + 1], high);
		for (int i = 0; i < 6; i++) {
			double range = fabs(high[i] - low[i]), slope = step > 0 ? values[i] - before[i] : 0;
			assert_true(values[i] >= fmin(low[i], high[i]) * (1 - 1e-12) && values[i] <= fmax(low[i], high[i]) * (1 + 1e-12));
			assert_true(fabs(slope) <= 0.006 * range + 1e-12);
			if (step > 1 && degrees <= table->zenith_deg[LAST])
				assert_true(fabs(slope - slope_before[i]) < 1e-4 * fmax(values[i], 1));
			slope_before[i] = slope;
			before[i] = values[i];
		}
	}
}

static void rows_interpolated(void **state)
{
	struct fixture *fixture = *state;
	const struct paper_fit_table published = paper_fit_table_published();
	check_interpolation(&published);
	check_interpolation(&fixture->table);
	assert_float_equal(paper_fit_table_at(&published, -1).b, printed[0][1], 1e-12);
	assert_float_equal(paper_fit_table_at(&published, NAN).b, printed[0][1], 1e-12);
	assert_float_equal(paper_fit_table_at(&published, 3).b, printed[LAST][1], 1e-12);
	assert_float_equal(paper_fit_table_at(&fixture->table, 89 * DEGREE).c, fixture->table.row[LAST].c, 1e-12);
}

/* 2 integral T_ms mu dmu, by the midpoint rule. */
static double spherical_by_sum(const struct paper_fit_table *table, double thickness_m)
{
	enum { STEPS = 2000 };
	double sum = 0;
	for (int i = 0; i < STEPS; i++) {
		double mu = (i + 0.5) / STEPS;
		struct paper_fit fit = paper_fit_table_at(table, acos(mu));
		sum += 2 * mu * paper_transmittance(&fit, thickness_m) / STEPS;
	}
	return sum;
}

static void spherical_transmittance(void **state)
{
	struct fixture *fixture = *state;
	const struct paper_fit_table published = paper_fit_table_published();
	double worst = 0;
	assert_float_equal(paper_fit_table_spherical(&published, 0), 1, 1e-9);
	for (double h = 0.5; h < 1e5; h *= 1.5) {
		assert_near(paper_fit_table_spherical(&published, h), spherical_by_sum(&published, h), 2e-4, "appendix B, spherical T");
		double t = paper_fit_table_spherical(&fixture->table, h);
		assert_near(t, spherical_by_sum(&fixture->table, h), 2e-4, "spherical T");
		double solved = slab_flux_spherical(fixture->solution, BAND, h * fixture->table.extinction_per_m).transmitted;
		worst = fmax(worst, fabs(t - solved));
	}
	print_message("spherical transmittance: at most %.4f off the solver's\n", worst);
	assert_near(worst, 0, 0.004, "spherical T against the solver's");
}

/* --- quality ------------------------------------------------------------------------------------------------------------------- */

/* Of T_ms and of T1, T2, R1, R2 against the solver's, at other thicknesses than those of the fit, by similarity. */
struct errors {
	double total, order;
};

static struct errors errors_at(const struct fixture *fixture, const struct paper_fit_table *table, double zenith)
{
	const double left = 1 - fixture->optics->forward_peak_fraction[BAND], mu = cos(zenith);
	const struct paper_fit fit = paper_fit_table_at(table, zenith);
	double total = 0, order = 0;
	int totals = 0, orders = 0;
	for (double tau = 0.07; tau < 500; tau *= 1.2, totals++) {
		double error = paper_transmittance(&fit, tau / table->extinction_per_m) -
			       slab_flux_at(fixture->solution, BAND, tau, mu).transmitted;
		total += error * error;
	}
	for (double tau = 0.035; tau < 7.5; tau *= 1.4)
		for (int i = 1; i <= 2; i++, orders += 2) {
			struct slab_orders solved = slab_orders_at(fixture->optics, BAND, SLAB_PHASE_MODIFIED, tau / left, mu);
			struct paper_first_orders first = paper_first_orders_at(&fit, tau / table->extinction_modified_per_m);
			double t = first.t[i] - solved.t[i], r = first.r[i] - solved.r[i];
			order += t * t + r * r;
		}
	return (struct errors){sqrt(total / totals), sqrt(order / orders)};
}

/* What the form can do, per row, for any droplets: the nearer to the horizon, the less are an exponential and a column like light that is
 * scattered first and then goes on along any direction. */
static const double total_bound[PAPER_FIT_ROWS] = {.0006, .0006, .0007, .001, .0015, .0035, .0025, .0015, .008, .025};
static const double order_bound[PAPER_FIT_ROWS] = {.003, .003, .003, .0035, .004, .0055, .008, .0095, .0125, .07};

static void papers_droplets(void **state)
{
	struct fixture *fixture = *state;
	const struct paper_fit_table published = paper_fit_table_published();
	for (int row = 0; row < PAPER_FIT_ROWS; row++) {
		double zenith = fixture->table.zenith_deg[row] * DEGREE;
		struct errors fitted = errors_at(fixture, &fixture->table, zenith), paper = errors_at(fixture, &published, zenith);
		print_message("%2.0f degrees: T_ms %.4f (appendix B %.4f), orders %.4f (%.4f)\n", fixture->table.zenith_deg[row],
			      fitted.total, paper.total, fitted.order, paper.order);
		assert_near(fitted.total, 0, total_bound[row], "rms of T_ms");
		assert_near(fitted.order, 0, order_bound[row], "rms of orders");
		assert_true(fitted.total < paper.total && fitted.order < paper.order);
		assert_near(fixture->table.total_rms[row], fitted.total, 0.2 * fitted.total, "stated rms of T_ms");
		assert_near(fixture->table.order_rms[row], fitted.order, 0.2 * fitted.order, "stated rms of orders");
	}
}

/* Halfway between rows, where nothing was fitted. */
static void between_rows(void **state)
{
	struct fixture *fixture = *state;
	for (int degrees = 5; degrees <= 85; degrees += 10) {
		struct errors errors = errors_at(fixture, &fixture->table, degrees * DEGREE);
		print_message("%2d degrees: T_ms %.4f, orders %.4f\n", degrees, errors.total, errors.order);
		assert_near(errors.total, 0, degrees < 80 ? 0.009 : 0.025, "rms of T_ms between rows");
		assert_near(errors.order, 0, degrees < 80 ? 0.011 : 0.04, "rms of orders between rows");
	}
}

/* --- parameters that are known --------------------------------------------------------------------------------------------------- */

/* Samples of the model itself, with b as in reality and c mu/a up to `spread` times 3 or a third of it. */
static struct paper_fit_totals model_totals(double spread, struct paper_fit row[PAPER_FIT_ROWS])
{
	struct paper_fit_totals samples;
	double a = 0.08 + 0.07 * random_unit();
	for (int i = 0; i < PAPER_FIT_ROWS; i++) {
		samples.mu[i] = cos(fmin(10 * i, 88) * DEGREE);
		row[i] = (struct paper_fit){.beta = 1 / (1 + a), .b = 0.4 + 0.75 * samples.mu[i] + 0.05 * random_unit()};
		row[i].c = 3 * pow(spread, 2 * random_unit() - 1) * a / samples.mu[i];
		for (int k = 0; k < PAPER_FIT_TOTALS; k++) {
			samples.tau[k] = exp2(0.5 * k - 4);
			samples.transmitted[i][k] = paper_transmittance(&row[i], samples.tau[k]);
		}
	}
	return samples;
}

static void totals_recovered(void **state)
{
	(void)state;
	for (int i = 0; i < 20; i++) {
		struct paper_fit known[PAPER_FIT_ROWS], fit[PAPER_FIT_ROWS];
		const struct paper_fit_totals samples = model_totals(1.3, known);
		assert_true(paper_fit_solve_totals(&samples, 0, fit));
		for (int row = 0; row < PAPER_FIT_ROWS; row++) {
			assert_near(fit[row].beta / known[row].beta, 1, 1e-5, "beta");
			assert_near(fit[row].b / known[row].b, 1, 1e-4, "b");
			if (fabs(known[row].b - 1) > 0.05) /* else c has no effect */
				assert_near(fit[row].c / known[row].c, 1, 2e-3, "c");
		}
		/* The prior moves parameters, but not by more than it is worth. */
		assert_true(paper_fit_solve_totals(&samples, PAPER_FIT_PRIOR, fit));
		for (int row = 0; row < PAPER_FIT_ROWS; row++)
			for (int k = 0; k < PAPER_FIT_TOTALS; k++)
				assert_near(paper_transmittance(&fit[row], samples.tau[k]), samples.transmitted[row][k], 0.002, "T_ms");
	}
}

static void orders_recovered(void **state)
{
	(void)state;
	for (int i = 0; i < 100; i++) {
		struct paper_fit_orders samples = {.mu = 0.035 + 0.965 * random_unit()};
		struct paper_fit fit = {0}, known = {.t = 0.3 + 0.7 * random_unit(), .r = 0.03 + 0.9 * random_unit()};
		known.kappa_c = (0.7 + 0.6 * random_unit()) / (samples.mu + 0.1);
		for (int k = 0; k < PAPER_FIT_ORDERS; k++) {
			samples.tau[k] = 0.03 * pow(8 / 0.03, (double)k / (PAPER_FIT_ORDERS - 1));
			struct paper_first_orders first = paper_first_orders_at(&known, samples.tau[k]);
			samples.orders[k] = (struct slab_orders){.t = {0, first.t[1], first.t[2], 0}, .r = {0, first.r[1], first.r[2], 0}};
		}
		assert_true(paper_fit_solve_orders(&samples, &fit));
		assert_near(fit.kappa_c / known.kappa_c, 1, 1e-5, "kappa_c");
		assert_near(fit.t / known.t, 1, 1e-5, "t");
		assert_near(fit.r / known.r, 1, 1e-5, "r");
	}
}

/* --- any droplets ---------------------------------------------------------------------------------------------------------------- */

static void check_sound(const struct paper_fit_table *table)
{
	for (int degrees = 0; degrees <= 90; degrees += 5) {
		const struct paper_fit fit = paper_fit_table_at(table, degrees * DEGREE);
		const double mu = fmax(cos(degrees * DEGREE), 1e-3);
		double before = 1;
		for (double tau = 1e-6; tau < 1e7; tau *= 2) {
			double thickness = tau / table->extinction_per_m;
			struct paper_orders orders = paper_orders_at(&fit, thickness, thickness * table->extinction_modified_per_m / mu);
			double sum = 0, t = paper_transmittance(&fit, thickness), diffuse = paper_fit_table_spherical(table, thickness);
			for (int i = 0; i < 4; i++) {
				assert_true(orders.t[i] >= 0 && orders.r[i] >= 0);
				sum += orders.t[i] + orders.r[i];
			}
			assert_near(sum, 1, 1e-9, "sum of orders");
			assert_true(t >= 0 && t <= before && diffuse >= 0 && diffuse <= 1);
			before = t;
		}
		assert_true(before < 1e-4);
	}
	assert_true(isfinite(paper_fit_table_spherical(table, INFINITY)));
}

static void check_quality(const struct paper_fit_table *table)
{
	for (int row = 0; row < PAPER_FIT_ROWS; row++) {
		double values[6];
		fit_values(&table->row[row], values);
		for (int i = 0; i < 6; i++)
			assert_true(isfinite(values[i]) && values[i] > 0);
		assert_true(table->row[row].beta < 1);
		assert_near(table->total_rms[row], 0, total_bound[row], "rms of T_ms");
		assert_near(table->order_rms[row], 0, order_bound[row], "rms of orders");
	}
}

/* The same phase function with another extinction: the same fit in optical units. */
static void check_similar(const struct paper_fit_table *table, const struct paper_fit_table *other)
{
	const double scale = other->extinction_per_m / table->extinction_per_m;
	assert_near(other->extinction_modified_per_m / table->extinction_modified_per_m, scale, 1e-12 * scale, "kappa_S");
	for (int row = 0; row < PAPER_FIT_ROWS; row++) {
		const struct paper_fit *fit = &table->row[row], *like = &other->row[row];
		assert_near((1 / like->beta - 1) / (1 / fit->beta - 1), scale, 1e-6 * scale, "1/beta - 1");
		assert_near(like->c / fit->c, scale, 1e-6 * scale, "c");
		assert_near(like->kappa_c / fit->kappa_c, scale, 1e-6 * scale, "kappa_c");
		assert_near(like->b, fit->b, 1e-6, "b");
		assert_near(like->t, fit->t, 1e-6, "t");
		assert_near(like->r, fit->r, 1e-6, "r");
	}
}

/* As many droplets as api.md admits. */
static double most_droplets(struct scene_dsd dsd)
{
	dsd.n0_per_cm3 = 1;
	return fmin(5000, 5 / scene_dsd_liquid_water(&dsd));
}

/* One shape of distribution, few and many droplets, exact and by the paper's rule. */
static int check_droplets(const struct kernel *kernel, struct scene_dsd dsd)
{
	struct slab_solution *solution = NULL;
	struct paper_fit_table table[4];
	for (int i = 0; i < 4; i++) {
		dsd.n0_per_cm3 = i == 0 ? 1 : i == 1 ? most_droplets(dsd) : pow(most_droplets(dsd), random_unit());
		struct optics *optics = optics_create(kernel, &dsd, i < 3 ? OPTICS_MIE : OPTICS_PAPER);
		assert_non_null(optics);
		if (!solution) /* of this shape: it knows no extinction */
			solution = slab_solve(optics, 2);
		assert_non_null(solution);
		assert_true(paper_fit_table_compute(optics, solution, 2, &table[i]));
		assert_near(table[i].extinction_per_m, optics->extinction_per_m[BAND], 0, "kappa");
		check_quality(&table[i]);
		check_sound(&table[i]);
		check_similar(&table[0], &table[i]);
		optics_destroy(optics);
	}
	slab_destroy(solution);
	return 4;
}

static void any_droplets(void **state)
{
	struct fixture *fixture = *state;
	static const double corners[][2] = {{1, 1}, {1, 30}, {20, 1}, {20, 30}};
	int count = 0;
	for (int i = 0; i < 16; i++) {
		struct scene_dsd dsd = {1, 1 + 19 * random_unit(), pow(30, random_unit())};
		if (i < 4)
			dsd = (struct scene_dsd){1, corners[i][0], corners[i][1]};
		count += check_droplets(fixture->kernel, dsd);
	}
	print_message("%d distributions\n", count);
	assert_true(count >= 60);
}

static void threads_agree(void **state)
{
	struct fixture *fixture = *state;
	static const int threads[] = {0, 1, 3, 1000};
	for (size_t i = 0; i < sizeof threads / sizeof *threads; i++) {
		struct paper_fit_table table;
		assert_true(paper_fit_table_compute(fixture->optics, fixture->solution, threads[i], &table));
		assert_memory_equal(&table, &fixture->table, sizeof table);
	}
}

/* What is not finite is refused, whichever way it comes in. */
static void damaged_input(void **state)
{
	struct fixture *fixture = *state;
	struct paper_fit_table table, untouched;
	memset(&table, 7, sizeof table);
	memcpy(&untouched, &table, sizeof table);
	struct slab_solution *solution = malloc(sizeof *solution);
	assert_non_null(solution);
	memcpy(solution, fixture->solution, sizeof *solution);
	struct slab_band *band = &solution->band[BAND];
	for (int depth = 0; depth < SLAB_DEPTH_COUNT; depth++)
		for (int i = 0; i < SLAB_NODE_COUNT; i++)
			band->flux[SLAB_TRANSMITTED][depth][i] = NAN;
	assert_false(paper_fit_table_compute(fixture->optics, solution, 1, &table));
	free(solution);

	struct optics optics = *fixture->optics;
	optics.extinction_per_m[BAND] = INFINITY;
	assert_false(paper_fit_table_compute(&optics, fixture->solution, 1, &table));
	assert_memory_equal(&table, &untouched, sizeof table);
}

static int set_up(void **state)
{
	static struct fixture fixture;
	const char *path = getenv("STRATUS_KERNEL");
	fixture.kernel = kernel_load(path ? path : "build/mie.kernel");
	fixture.optics = fixture.kernel ? optics_create(fixture.kernel, &(struct scene_dsd){300, 2, 7}, OPTICS_MIE) : NULL;
	fixture.solution = fixture.optics ? slab_solve(fixture.optics, 2) : NULL;
	*state = &fixture;
	return fixture.solution && paper_fit_table_compute(fixture.optics, fixture.solution, 2, &fixture.table) ? 0 : -1;
}

static int tear_down(void **state)
{
	struct fixture *fixture = *state;
	slab_destroy(fixture->solution);
	optics_destroy(fixture->optics);
	kernel_destroy(fixture->kernel);
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(rows_as_printed),  cmocka_unit_test(rows_interpolated), cmocka_unit_test(spherical_transmittance),
		cmocka_unit_test(papers_droplets),  cmocka_unit_test(between_rows),      cmocka_unit_test(totals_recovered),
		cmocka_unit_test(orders_recovered), cmocka_unit_test(any_droplets),      cmocka_unit_test(threads_agree),
		cmocka_unit_test(damaged_input),
	};
	return cmocka_run_group_tests(tests, set_up, tear_down);
}
