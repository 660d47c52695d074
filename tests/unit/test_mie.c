/* The Mie series against published and independently computed values. */
#include "renderer/optics/mie.h"

#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

struct sphere {
	double x;
	int count;
	struct mie_term *terms;
	struct mie_efficiency efficiency;
};

static struct sphere sphere_create(double x, double m)
{
	struct sphere sphere = {.x = x, .count = mie_term_count(x)};
	double *scratch = malloc(mie_scratch_count(x, m) * sizeof *scratch);
	sphere.terms = malloc(sphere.count * sizeof *sphere.terms);
	assert_non_null(scratch);
	assert_non_null(sphere.terms);
	mie_terms(x, m, sphere.terms, scratch);
	sphere.efficiency = mie_efficiency(x, sphere.terms, sphere.count);
	free(scratch);
	return sphere;
}

static double sphere_phase(const struct sphere *sphere, double angle)
{
	double complex amplitude[2];
	mie_amplitudes(sphere->terms, sphere->count, cos(angle), amplitude);
	return mie_phase(sphere->x, sphere->efficiency.scattering, amplitude);
}

static json_t *load_reference(void)
{
	json_t *root = json_load_file("tests/data/mie.json", JSON_REJECT_DUPLICATES, NULL);
	assert_non_null(root);
	return root;
}

/* Wiscombe's MIEV0 test cases, printed with six decimals: half a unit of the last place, and one case of rounding in print. */
static void published_values(void **state)
{
	(void)state;
	json_t *root = load_reference(), *value;
	size_t i;
	int tested = 0;
	json_array_foreach(json_object_get(root, "a_check_published_MIEV0"), i, value)
	{
		const json_t *m = json_object_get(value, "m"), *published = json_object_get(value, "published_Qext_Qsca_g");
		if (json_number_value(json_array_get(m, 1)) != 0)
			continue; /* absorbing */
		struct sphere sphere =
			sphere_create(json_number_value(json_object_get(value, "x")), json_number_value(json_array_get(m, 0)));
		assert_float_equal(sphere.efficiency.extinction, json_number_value(json_array_get(published, 0)), 1e-6);
		assert_float_equal(sphere.efficiency.scattering, json_number_value(json_array_get(published, 1)), 1e-6);
		assert_float_equal(sphere.efficiency.asymmetry, json_number_value(json_array_get(published, 2)), 1e-6);
		free(sphere.terms);
		tested++;
	}
	assert_int_equal(tested, 5);
	json_decref(root);
}

static void assert_relative(double value, double expected, double tolerance)
{
	if (!(fabs(value - expected) <= tolerance * fabs(expected)))
		fail_msg("%.12g instead of %.12g", value, expected);
}

static void water_spheres(void **state)
{
	(void)state;
	json_t *root = load_reference(), *value, *phase;
	const char *name, *degrees;
	json_object_foreach(json_object_get(root, "a_monodisperse_m1.333"), name, value)
	{
		struct sphere sphere = sphere_create(json_number_value(json_object_get(value, "x")), 1.333);
		assert_relative(sphere.efficiency.extinction, json_number_value(json_object_get(value, "Qext")), 1e-9);
		assert_relative(sphere.efficiency.asymmetry, json_number_value(json_object_get(value, "g")), 1e-9);
		json_object_foreach(json_object_get(value, "P"), degrees, phase)
		{
			double angle = strtod(degrees, NULL) * M_PI / 180;
			assert_relative(sphere_phase(&sphere, angle), json_number_value(phase), 1e-6);
		}
		free(sphere.terms);
	}
	json_decref(root);
}

/* Rayleigh's limit: Q = 8/3 x^4 ((m^2-1)/(m^2+2))^2, P = 3/4 (1 + cos^2), g = 0. */
static void small_sphere(void **state)
{
	(void)state;
	struct sphere sphere = sphere_create(0.01, 1.5);
	double contrast = (1.5 * 1.5 - 1) / (1.5 * 1.5 + 2);
	assert_relative(sphere.efficiency.extinction, 8.0 / 3 * pow(0.01, 4) * contrast * contrast, 1e-3);
	assert_float_equal(sphere.efficiency.asymmetry, 0, 1e-4);
	for (double angle = 0; angle <= M_PI; angle += 0.1)
		assert_relative(sphere_phase(&sphere, angle), 0.75 * (1 + cos(angle) * cos(angle)), 1e-3);
	free(sphere.terms);
}

/* A sphere of the surrounding medium scatters nothing; the optical theorem Q_ext = 4/x^2 Re S(0); energy is kept. */
static void identities(void **state)
{
	(void)state;
	struct sphere none = sphere_create(20, 1);
	assert_float_equal(none.efficiency.extinction, 0, 1e-20);
	free(none.terms);
	static const double sizes[] = {0.1, 1, 3.7, 30, 400, 3500};
	for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
		struct sphere sphere = sphere_create(sizes[i], 1.337);
		double complex forward[2], back[2];
		mie_amplitudes(sphere.terms, sphere.count, 1, forward);
		mie_amplitudes(sphere.terms, sphere.count, -1, back);
		assert_relative(4 / (sizes[i] * sizes[i]) * creal(forward[0]), sphere.efficiency.extinction, 1e-9);
		assert_relative(sphere.efficiency.scattering, sphere.efficiency.extinction, 1e-10);
		assert_true(cabs(forward[0] - forward[1]) <= 1e-9 * cabs(forward[0]));
		assert_true(cabs(back[0] + back[1]) <= 1e-7 * cabs(forward[0]));
		free(sphere.terms);
	}
}

/* Norm and first moment of P by Simpson's rule are those of the series. */
static void phase_moments(void **state)
{
	(void)state;
	struct sphere sphere = sphere_create(10, 1.333);
	enum { STEPS = 4000 };
	double norm = 0, moment = 0;
	for (int i = 0; i <= STEPS; i++) {
		double angle = i * M_PI / STEPS, weight = (i == 0 || i == STEPS ? 1 : i % 2 ? 4 : 2) * M_PI / STEPS / 3;
		double flux = weight * sin(angle) / 2 * sphere_phase(&sphere, angle);
		norm += flux;
		moment += flux * cos(angle);
	}
	assert_float_equal(norm, 1, 1e-8);
	assert_float_equal(moment, sphere.efficiency.asymmetry, 1e-8);
	free(sphere.terms);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(published_values), cmocka_unit_test(water_spheres), cmocka_unit_test(small_sphere),
		cmocka_unit_test(identities),       cmocka_unit_test(phase_moments),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
