/* The optics of any droplets against straight sums over single spheres: a grid of its own in the radius, one angle at a time, no table. */
#include "tests/validate/validate.h"

#include "renderer/optics/mie.h"

#include <pthread.h>
#include <stdlib.h>

enum { ANGLES = 25, PEAK_ANGLES = 64, THREADS = 2 };

static const double degrees[ANGLES] = {0,  0.5, 1,   2,   3,   5,   7,   10,  15,  20,  30,  45, 60,
				       75, 90,  105, 120, 135, 140, 142, 145, 160, 175, 178, 180};

/* Sums over the spheres of one thread. */
struct sums {
	double extinction, asymmetry, phase[ANGLES], peak;
};

struct task {
	struct scene_dsd dsd;
	int band, first; /* of every THREADS spheres */
	struct sums sums;
};

/* Chance to be scattered by less than 5 degrees: Simpson's rule over the square root of the angle. */
static double peak_of(double x, double efficiency, const struct mie_term *terms, int count)
{
	double sum = 0;
	for (int i = 1; i <= PEAK_ANGLES; i++) {
		const double t = (double)i / PEAK_ANGLES, angle = FORWARD_PEAK_ANGLE * t * t, weight = i == PEAK_ANGLES ? 1 : i % 2 ? 4 : 2;
		double complex amplitude[2];
		mie_amplitudes(terms, count, cos(angle), amplitude);
		sum += weight * 2 * t * sin(angle) * mie_phase(x, efficiency, amplitude);
	}
	return sum * FORWARD_PEAK_ANGLE / PEAK_ANGLES / 3 / 2;
}

static void add_sphere(struct sums *sums, double x, double m, double number)
{
	const int count = mie_term_count(x);
	struct mie_term *terms = malloc((size_t)count * sizeof *terms);
	double *scratch = malloc((size_t)mie_scratch_count(x, m) * sizeof *scratch);
	require(terms && scratch, "out of memory");
	mie_terms(x, m, terms, scratch);
	const struct mie_efficiency efficiency = mie_efficiency(x, terms, count);
	const double section = number * efficiency.extinction;
	sums->extinction += section;
	sums->asymmetry += section * efficiency.asymmetry;
	for (int k = 0; k < ANGLES; k++) {
		double complex amplitude[2];
		mie_amplitudes(terms, count, cos(degrees[k] * DEGREE), amplitude);
		sums->phase[k] += section * mie_phase(x, efficiency.scattering, amplitude);
	}
	sums->peak += section * peak_of(x, efficiency.scattering, terms, count);
	free(terms);
	free(scratch);
}

/* Steps of 0.03 and a 6000th of the size parameter, over all spheres whose share of the cross-section is above a millionth of the
 * largest.
 */
static void *sum_spheres(void *argument)
{
	struct task *task = argument;
	const double wavelength_m = 1e-9 * band_wavelength_nm[task->band],
		     rn = 1e-6 * task->dsd.effective_radius_um / (task->dsd.gamma + 2);
	const double gamma = task->dsd.gamma, mode = gamma + 1, largest = pow(mode, mode) * exp(-mode);
	const double per_x = wavelength_m / (2 * M_PI), constant = 1e6 * task->dsd.n0_per_cm3 / (tgamma(gamma) * rn);
	double x = 0.1, step;
	for (int i = 0; x * per_x < (mode + 30 + 6 * sqrt(mode)) * rn; i++, x += step) {
		step = fmax(0.03, x / 6000);
		const double r = x * per_x, u = r / rn;
		if (i % THREADS != task->first || pow(u, mode) * exp(-u) < 1e-6 * largest)
			continue;
		const double number = constant * pow(u, gamma - 1) * exp(-u) * M_PI * r * r * step * per_x;
		add_sphere(&task->sums, x, band_refractive_index[task->band], number);
	}
	return NULL;
}

static struct sums sum_all(struct scene_dsd dsd, int band)
{
	struct task task[THREADS];
	pthread_t thread[THREADS];
	struct sums sums = {0};
	for (int i = 0; i < THREADS; i++) {
		task[i] = (struct task){.dsd = dsd, .band = band, .first = i};
		require(pthread_create(&thread[i], NULL, sum_spheres, &task[i]) == 0, "no thread");
	}
	for (int i = 0; i < THREADS; i++) {
		pthread_join(thread[i], NULL);
		sums.extinction += task[i].sums.extinction;
		sums.asymmetry += task[i].sums.asymmetry;
		sums.peak += task[i].sums.peak;
		for (int k = 0; k < ANGLES; k++)
			sums.phase[k] += task[i].sums.phase[k];
	}
	return sums;
}

static void compare(struct validation *validation, struct scene_dsd dsd, int band)
{
	struct tally *tally = validation->measured.tally;
	struct optics *optics = optics_create(validation->kernel, &dsd, OPTICS_MIE);
	require(optics, "no optics");
	const struct sums sums = sum_all(dsd, band);
	char where[96];
	snprintf(where, sizeof where, "gamma %.3g, re %.3g um, %.0f nm", dsd.gamma, dsd.effective_radius_um, band_wavelength_nm[band]);
	tally_add(&tally[TALLY_SPHERES_EXTINCTION], fabs(optics->extinction_per_m[band] / sums.extinction - 1), "%s", where);
	tally_add(&tally[TALLY_SPHERES_ASYMMETRY], fabs(optics->asymmetry[band] - sums.asymmetry / sums.extinction), "%s", where);
	tally_add(&tally[TALLY_SPHERES_PEAK_FRACTION], fabs(optics->forward_peak_fraction[band] - sums.peak / sums.extinction), "%s",
		  where);
	for (int k = 0; k < ANGLES; k++) {
		const double expected = sums.phase[k] / sums.extinction;
		const double error = fabs(optics_phase(optics, band, degrees[k] * DEGREE) / expected - 1);
		if (degrees[k] == 180)
			tally_add(&tally[TALLY_SPHERES_PHASE_BACKWARD], error, "%s", where);
		else if (degrees[k] >= 1 && degrees[k] <= 178)
			tally_add(&tally[TALLY_SPHERES_PHASE], error, "%g deg, %s", degrees[k], where);
	}
	optics_destroy(optics);
}

void validate_spheres(struct validation *validation)
{
	for (int i = 0, count = effort_count(validation, 12); i < count; i++)
		compare(validation, droplets_at(i), i % BAND_COUNT);
}
