/* The kernel table and the optics made from it. Wants build/mie.kernel, or the file that STRATUS_KERNEL names. */
#include "renderer/optics/kernel.h"
#include "renderer/optics/mie.h"
#include "renderer/optics/optics.h"
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
#include <unistd.h>
#include <cmocka.h>

#define DEGREE (M_PI / 180)

static const char *kernel_path(void)
{
	const char *path = getenv("STRATUS_KERNEL");
	return path ? path : "build/mie.kernel";
}

static void assert_relative(double value, double expected, double tolerance, const char *what)
{
	if (!(fabs(value - expected) <= tolerance * fabs(expected)))
		fail_msg("%s: %.9g instead of %.9g (%+.3f %%)", what, value, expected, 100 * (value / expected - 1));
}

static struct optics *make(void **state, double n0, double gamma, double re)
{
	struct optics *optics = optics_create(*state, &(struct scene_dsd){n0, gamma, re}, OPTICS_MIE);
	assert_non_null(optics);
	return optics;
}

/* 1/2 integral of f dmu from angle `first` on. */
static double mean_from(const struct optics *optics, const double *f, int first)
{
	double sum = 0;
	for (int i = first; i < optics->angle_count; i++)
		sum += optics->weight[i] * f[i];
	return sum / 2;
}

/* --- against sums over single spheres ----------------------------------------------------------------------------------------- */

enum { ORACLE_ANGLES = 14 };
static const double oracle_degrees[ORACLE_ANGLES] = {0, 0.5, 1, 3, 5, 10, 30, 60, 90, 120, 140, 160, 175, 180};

struct oracle {
	double extinction, asymmetry, phase[ORACLE_ANGLES];
};

/* Straight sums over the radius on a grid of their own: no bins, no mirror symmetry, one angle at a time. */
static struct oracle oracle_sum(const struct scene_dsd *dsd, int band)
{
	enum { STEPS = 4000, TERMS = 128, SCRATCH = 256 };
	double wavelength_m = 1e-9 * band_wavelength_nm[band], m = band_refractive_index[band];
	double rn = 1e-6 * dsd->effective_radius_um / (dsd->gamma + 2), step = 0.02;
	struct oracle oracle = {0};
	for (int i = 0; i < STEPS; i++) {
		struct mie_term terms[TERMS];
		double scratch[SCRATCH], x = 0.05 + step * (i + 0.37), r = x * wavelength_m / (2 * M_PI);
		int count = mie_term_count(x);
		assert_true(count <= TERMS && mie_scratch_count(x, m) <= SCRATCH);
		mie_terms(x, m, terms, scratch);
		struct mie_efficiency efficiency = mie_efficiency(x, terms, count);
		double number = 1e6 * dsd->n0_per_cm3 / (tgamma(dsd->gamma) * rn) * pow(r / rn, dsd->gamma - 1) * exp(-r / rn);
		double section = number * M_PI * r * r * efficiency.extinction * step * wavelength_m / (2 * M_PI);
		oracle.extinction += section;
		oracle.asymmetry += section * efficiency.asymmetry;
		for (int k = 0; k < ORACLE_ANGLES; k++) {
			double complex amplitude[2];
			mie_amplitudes(terms, count, cos(oracle_degrees[k] * DEGREE), amplitude);
			oracle.phase[k] += section * mie_phase(x, efficiency.scattering, amplitude);
		}
	}
	oracle.asymmetry /= oracle.extinction;
	for (int k = 0; k < ORACLE_ANGLES; k++)
		oracle.phase[k] /= oracle.extinction;
	return oracle;
}

static void kernel_against_spheres(void **state)
{
	struct scene_dsd dsd = {100, 8, 1.5};
	struct optics *optics = make(state, dsd.n0_per_cm3, dsd.gamma, dsd.effective_radius_um);
	for (int band = 0; band < BAND_COUNT; band++) {
		struct oracle oracle = oracle_sum(&dsd, band);
		assert_relative(optics->extinction_per_m[band], oracle.extinction, 5e-4, "extinction");
		assert_float_equal(optics->asymmetry[band], oracle.asymmetry, 2e-4);
		for (int k = 0; k < ORACLE_ANGLES; k++)
			assert_relative(optics_phase(optics, band, oracle_degrees[k] * DEGREE), oracle.phase[k], 5e-3, "phase");
	}
	optics_destroy(optics);
}

/* --- against the reference distribution --------------------------------------------------------------------------------------- */

static double fogbow_angle(const struct optics *optics, int band)
{
	double best = 0;
	for (double degrees = 130; degrees < 155; degrees += 0.05)
		if (best == 0 || optics_phase(optics, band, degrees * DEGREE) > optics_phase(optics, band, best * DEGREE))
			best = degrees;
	return best;
}

static void reference_distribution(void **state)
{
	json_t *root = json_load_file("tests/data/mie.json", JSON_REJECT_DUPLICATES, NULL), *value;
	assert_non_null(root);
	struct optics *optics = make(state, 300, 2, 7);
	for (int band = 0; band < BAND_COUNT; band++) {
		json_t *expected = json_array_get(json_object_get(root, "b_polydisperse"), band);
		const char *degrees;
		assert_float_equal(1000 * number(expected, "lambda_um"), band_wavelength_nm[band], 1e-9);
		assert_float_equal(number(expected, "m_real"), band_refractive_index[band], 1e-12);
		assert_relative(optics->extinction_per_m[band], number(expected, "kappa_exact_per_m"), 1e-3, "extinction");
		assert_float_equal(optics->asymmetry[band], number(expected, "g"), 1e-4);
		assert_float_equal(optics->forward_peak_fraction[band], number(expected, "Pf_5deg"), 1e-4);
		assert_float_equal(fogbow_angle(optics, band), number(expected, "fogbow_max_deg"), 0.3);
		/* Ripple of single spheres is what is left in the glory; everywhere else interpolation. */
		json_object_foreach(json_object_get(expected, "P"), degrees, value)
		{
			double angle = strtod(degrees, NULL), tolerance = angle > 165 ? 0.01 : 0.005;
			assert_relative(optics_phase(optics, band, angle * DEGREE), json_number_value(value), tolerance, degrees);
		}
		size_t i;
		json_array_foreach(json_object_get(expected, "P_fine"), i, value)
		{
			double angle = json_number_value(json_array_get(value, 0)), phase = json_number_value(json_array_get(value, 1));
			assert_relative(optics_phase(optics, band, angle * DEGREE), phase, angle > 165 ? 0.01 : 0.005, "fine");
		}
		json_array_foreach(json_object_get(expected, "moments_first_64_chi_l"), i, value)
			assert_float_equal(optics->moment[band][i], json_number_value(value), 2e-4);
		assert_int_equal(i, 64);
	}
	optics_destroy(optics);
	json_decref(root);
}

/* --- what must hold for every distribution ------------------------------------------------------------------------------------ */

static void check_phase(const struct optics *optics, int band)
{
	const double *phase = optics->phase[band], *phase2 = optics->phase2[band];
	double fraction = optics->forward_peak_fraction[band];
	assert_float_equal(mean_from(optics, phase, 0), 1, 1e-9);
	assert_float_equal(mean_from(optics, phase, optics->forward_count), 1 - fraction, 1e-9);
	assert_float_equal(mean_from(optics, phase2, 0), 1, 1e-4);
	double square = 0;
	for (int i = 0; i < optics->angle_count; i++) {
		assert_true(isfinite(phase[i]) && phase[i] > 0);
		assert_true(isfinite(phase2[i]) && phase2[i] > 0.05);
		assert_true((i < optics->forward_count) == (optics->angle[i] < FORWARD_PEAK_ANGLE));
		if (i >= optics->forward_count)
			square += optics->weight[i] * phase[i] * phase[i] / (2 * (1 - fraction) * (1 - fraction));
	}
	/* Exactly forward, P_S convolved with itself is the mean of its square: a cusp, whose tip the series rounds off. */
	assert_relative(phase2[0], square, 1e-2, "P_2(0)");
}

static void check_moments(const struct optics *optics, int band)
{
	double fraction = optics->forward_peak_fraction[band];
	assert_float_equal(optics->moment[band][0], 1, 1e-12);
	assert_float_equal(optics->moment[band][1], optics->asymmetry[band], 1e-12);
	assert_float_equal(optics->moment_forward[band][0], 1, 1e-12);
	assert_float_equal(optics->moment_modified[band][0], 1, 1e-12);
	for (int l = 0; l < optics->moment_count; l++) {
		double sum = fraction * optics->moment_forward[band][l] + (1 - fraction) * optics->moment_modified[band][l];
		assert_float_equal(optics->moment[band][l], sum, 1e-12);
		assert_true(fabs(optics->moment[band][l]) <= 1 && fabs(optics->moment_forward[band][l]) <= 1 + 1e-12);
	}
	double second = 0;
	for (int i = 0; i < optics->angle_count; i++) {
		double mu = cos(optics->angle[i]);
		second += optics->weight[i] / 2 * optics->phase[band][i] * (1.5 * mu * mu - 0.5);
	}
	assert_float_equal(optics->moment[band][2], second, 1e-4);
}

static void whole_range(void **state)
{
	static const double gammas[] = {1, 2, 6, 20}, radii[] = {1, 3, 10, 30}, numbers[] = {1, 5000};
	for (int i = 0; i < 32; i++) {
		double gamma = gammas[i % 4], re = radii[i / 4 % 4], n0 = numbers[i / 16];
		struct optics *optics = make(state, n0, gamma, re);
		for (int band = 0; band < BAND_COUNT; band++) {
			/* Large spheres take twice their cross-section from the beam, those of the size of the wavelength up to four times.
			 */
			double rn = 1e-6 * re / (gamma + 2), section = 1e6 * n0 * M_PI * rn * rn * gamma * (gamma + 1);
			double efficiency = optics->extinction_per_m[band] / section;
			assert_in_range((int)(1000 * efficiency), 2010, 3700);
			if (re >= 10)
				assert_in_range((int)(1000 * efficiency), 2010, 2160);
			assert_in_range((int)(1000 * optics->asymmetry[band]), 700, 900);
			assert_in_range((int)(1000 * optics->forward_peak_fraction[band]), re >= 3 ? 290 : 80, 520);
			assert_true(optics->single_scattering_albedo[band] == 1);
			check_phase(optics, band);
			check_moments(optics, band);
		}
		optics_destroy(optics);
	}
}

/* The moments give P back. */
static void moments_give_phase(void **state)
{
	struct optics *optics = make(state, 300, 2, 7);
	for (double degrees = 2; degrees < 179; degrees += 7.3) {
		double mu = cos(degrees * DEGREE), before = 0, now = 1, sum = 0;
		for (int l = 0; l < optics->moment_count; l++) {
			sum += (2 * l + 1) * optics->moment[1][l] * now;
			double next = ((2 * l + 1) * mu * now - l * before) / (l + 1);
			before = now;
			now = next;
		}
		assert_relative(sum, optics_phase(optics, 1, degrees * DEGREE), 0.01, "sum of moments");
	}
	optics_destroy(optics);
}

/* P_2 by brute force: P_S over the sphere around one direction, seen from another. */
static void double_scattering_phase(void **state)
{
	struct optics *optics = make(state, 300, 2, 7);
	double kept = 1 - optics->forward_peak_fraction[1];
	static const double degrees[] = {0.3, 4, 20, 60, 100, 150, 179};
	for (size_t k = 0; k < sizeof degrees / sizeof *degrees; k++) {
		enum { AZIMUTHS = 720 };
		double mu = cos(degrees[k] * DEGREE), nu = sin(degrees[k] * DEGREE), sum = 0;
		for (int i = optics->forward_count; i < optics->angle_count; i++) {
			double inner = 0, mu_i = cos(optics->angle[i]), nu_i = sin(optics->angle[i]);
			for (int j = 0; j < AZIMUTHS; j++) {
				double angle = acos(fmin(fmax(mu * mu_i + nu * nu_i * cos((j + 0.5) * M_PI / AZIMUTHS), -1), 1));
				if (angle >= FORWARD_PEAK_ANGLE)
					inner += optics_phase(optics, 1, angle) / AZIMUTHS;
			}
			sum += optics->weight[i] / 2 * optics->phase[1][i] * inner / (kept * kept);
		}
		assert_relative(optics_phase2(optics, 1, degrees[k] * DEGREE), sum, 0.01, "P_2");
	}
	optics_destroy(optics);
}

static void interpolation(void **state)
{
	struct optics *optics = make(state, 300, 20, 30);
	for (int band = 0; band < BAND_COUNT; band++) {
		for (int i = 0; i + 1 < optics->angle_count; i++) {
			assert_true(optics->angle[i] < optics->angle[i + 1]);
			double low = optics->phase[band][i], high = optics->phase[band][i + 1];
			double middle = optics_phase(optics, band, (optics->angle[i] + optics->angle[i + 1]) / 2);
			assert_relative(optics_phase(optics, band, optics->angle[i]), low, 1e-9, "node");
			assert_true(middle >= 0.99 * fmin(low, high) && middle <= 1.01 * fmax(low, high));
		}
		assert_relative(optics_phase(optics, band, -1), optics->phase[band][0], 1e-12, "below");
		assert_relative(optics_phase(optics, band, 4), optics->phase[band][optics->angle_count - 1], 1e-12, "above");
	}
	optics_destroy(optics);
}

/* Half of the angles, interpolated, give the other half: with all of them the error of a cubic is some eight times less. */
static void interpolation_error(void **state)
{
	struct optics *full = make(state, 300, 2, 7), half = *full;
	double angle[2048], phase[2048];
	half.angle = angle;
	half.phase[1] = phase;
	half.angle_count = 0;
	assert_true(full->angle_count <= 2048);
	for (int i = 0; i < full->angle_count; i++)
		if (i % 2 == 0 || i == full->angle_count - 1) {
			angle[half.angle_count] = full->angle[i];
			phase[half.angle_count++] = full->phase[1][i];
		}
	for (int i = 1; i < full->angle_count; i += 2)
		assert_relative(optics_phase(&half, 1, full->angle[i]), full->phase[1][i], 1e-3, "left out");
	optics_destroy(full);
}

/* The paper's rule changes extinction alone. */
static void paper_model(void **state)
{
	struct scene_dsd dsd = {300, 2, 7};
	struct optics *mie = optics_create(*state, &dsd, OPTICS_MIE), *paper = optics_create(*state, &dsd, OPTICS_PAPER);
	assert_non_null(mie);
	assert_non_null(paper);
	for (int band = 0; band < BAND_COUNT; band++) {
		assert_float_equal(paper->extinction_per_m[band], 0.0461814, 1e-6);
		assert_memory_equal(paper->phase[band], mie->phase[band], mie->angle_count * sizeof(double));
		assert_true(paper->asymmetry[band] == mie->asymmetry[band]);
	}
	optics_destroy(mie);
	optics_destroy(paper);
	optics_destroy(NULL);
}

/* --- the file ----------------------------------------------------------------------------------------------------------------- */

/* Writes the kernel file to a temporary one, grown by `growth` bytes (cut if negative) and with a bit of byte `at` flipped (of the end if
 * negative, none if NOWHERE), and tries to load that. */
enum { NOWHERE = 1 << 30 };

static bool loads_changed(long at, long growth)
{
	FILE *source = fopen(kernel_path(), "rb");
	assert_non_null(source);
	fseek(source, 0, SEEK_END);
	long full = ftell(source), wanted = full + growth > 0 ? full + growth : 0;
	rewind(source);
	char *bytes = calloc(1, full + 16), path[] = "/tmp/stratus-test-XXXXXX";
	assert_non_null(bytes);
	assert_int_equal(fread(bytes, 1, full, source), full);
	fclose(source);
	if (at != NOWHERE)
		bytes[at < 0 ? full + at : at] ^= 0x10;
	int fd = mkstemp(path);
	assert_true(fd >= 0);
	assert_int_equal(write(fd, bytes, wanted), wanted);
	close(fd);
	free(bytes);
	struct kernel *kernel = kernel_load(path);
	unlink(path);
	kernel_destroy(kernel);
	return kernel != NULL;
}

static void damaged_files(void **state)
{
	(void)state;
	assert_true(loads_changed(NOWHERE, 0));
	assert_false(loads_changed(0, 0));       /* magic */
	assert_false(loads_changed(8, 0));       /* byte order */
	assert_false(loads_changed(12, 0));      /* version */
	assert_false(loads_changed(16, 0));      /* a count */
	assert_false(loads_changed(48, 0));      /* a refractive index */
	assert_false(loads_changed(4000000, 0)); /* payload */
	assert_false(loads_changed(-1, 0));      /* its last byte */
	assert_false(loads_changed(NOWHERE, -1));
	assert_false(loads_changed(NOWHERE, 1));
	assert_false(loads_changed(NOWHERE, -5000000));
	assert_false(loads_changed(NOWHERE, -1000000000)); /* an empty file */
	assert_null(kernel_load("/nonexistent/mie.kernel"));
	assert_null(kernel_load("/tmp"));
	kernel_destroy(NULL);
}

static int load_kernel(void **state)
{
	*state = kernel_load(kernel_path());
	return *state ? 0 : -1;
}

static int unload_kernel(void **state)
{
	kernel_destroy(*state);
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(kernel_against_spheres),
		cmocka_unit_test(reference_distribution),
		cmocka_unit_test(whole_range),
		cmocka_unit_test(moments_give_phase),
		cmocka_unit_test(double_scattering_phase),
		cmocka_unit_test(interpolation),
		cmocka_unit_test(interpolation_error),
		cmocka_unit_test(paper_model),
		cmocka_unit_test(damaged_files),
	};
	return cmocka_run_group_tests(tests, load_kernel, unload_kernel);
}
