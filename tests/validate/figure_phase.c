/* Figure 4: phase functions of the three bands, and of one droplet with its ripples. */
#include "tests/validate/validate.h"

#include "renderer/optics/mie.h"

#include <stdlib.h>

/* P of one droplet of 20 um in green light. */
struct sphere {
	double x, efficiency;
	int count;
	struct mie_term *terms;
};

static struct sphere sphere_init(double radius_um)
{
	struct sphere sphere = {.x = 2 * M_PI * radius_um * 1000 / band_wavelength_nm[1]};
	const double m = band_refractive_index[1];
	sphere.count = mie_term_count(sphere.x);
	sphere.terms = malloc((size_t)sphere.count * sizeof *sphere.terms);
	double *scratch = malloc((size_t)mie_scratch_count(sphere.x, m) * sizeof *scratch);
	require(sphere.terms && scratch, "out of memory");
	mie_terms(sphere.x, m, sphere.terms, scratch);
	sphere.efficiency = mie_efficiency(sphere.x, sphere.terms, sphere.count).scattering;
	free(scratch);
	return sphere;
}

static double sphere_phase(const struct sphere *sphere, double angle)
{
	double complex amplitude[2];
	mie_amplitudes(sphere->terms, sphere->count, cos(angle), amplitude);
	return mie_phase(sphere->x, sphere->efficiency, amplitude);
}

/* Where P is largest or least between two angles, degrees. */
static double extreme(const struct optics *optics, int band, double low, double high, double sign)
{
	double best = low;
	for (double degrees = low; degrees <= high; degrees += 0.02)
		if (sign * optics_phase(optics, band, degrees * DEGREE) > sign * optics_phase(optics, band, best * DEGREE))
			best = degrees;
	return best;
}

static void describe(FILE *page, const struct optics *optics, double ripple)
{
	fprintf(page,
		"\n## Figure 4: phase function\n\n![Phase function of the paper's droplets](figure4.svg)\n\n"
		"N0 300 cm^-3, gamma 2, re 7 um, all sizes together (colours), and one droplet of 20 um alone at 550 nm (grey). One "
		"droplet's P has a "
		"ripple for\n"
		"every size parameter, between 60 and 120 degrees over a factor %.0f; all together have none. Inset: the same in polar "
		"form, log P "
		"from 0.01\n"
		"(centre) on.\n\n"
		"| band | kappa in 1/m | asymmetry | P_f | P(0) | fogbow at | P there | glory's ring at | P(180) over P(175) |\n"
		"| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
		ripple);
	for (int band = 0; band < BAND_COUNT; band++) {
		const double fogbow = extreme(optics, band, 130, 160, 1), ring = extreme(optics, band, 176, 179, 1);
		fprintf(page, "| %.0f nm | %.4f | %.4f | %.4f | %.0f | %.1f deg | %.3f | %.1f deg | %.2f |\n", band_wavelength_nm[band],
			optics->extinction_per_m[band], optics->asymmetry[band], optics->forward_peak_fraction[band],
			optics_phase(optics, band, 0), fogbow, optics_phase(optics, band, fogbow * DEGREE), ring,
			optics_phase(optics, band, M_PI) / optics_phase(optics, band, 175 * DEGREE));
	}
	fprintf(page,
		"\nThe forward peak, the fogbow, higher and narrower in blue but hardly coloured, and the glory with its ring, red on the "
		"outside, are all\nthere. The paper says P_f = 51 %%; [paper-fit.md](paper-fit.md) says why it is less here.\n");
}

void figure_phase(struct validation *validation)
{
	struct optics *optics = optics_create(validation->kernel, &PAPER_DROPLETS, OPTICS_MIE);
	require(optics, "no optics");
	struct sphere sphere = sphere_init(20);
	FILE *file = figure_file(validation, "figure4");
	double low = INFINITY, high = 0;
	fprintf(file, "# degrees, P at 650, 550, 450 nm, P of one droplet of 20 um at 550 nm\n");
	for (int i = 0; i <= 1800; i++) {
		const double angle = i * 0.1 * DEGREE, single = sphere_phase(&sphere, angle);
		if (i > 600 && i < 1200) {
			low = fmin(low, single);
			high = fmax(high, single);
		}
		fprintf(file, "%g\t%.5g\t%.5g\t%.5g\t%.5g\n", i * 0.1, optics_phase(optics, 0, angle), optics_phase(optics, 1, angle),
			optics_phase(optics, 2, angle), single);
	}
	fclose(file);
	describe(validation->page, optics, high / low);
	free(sphere.terms);
	optics_destroy(optics);
}
