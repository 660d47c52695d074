/* What must hold for every layer of any droplets: nothing is lost, and light can be sent back. */
#include "tests/validate/validate.h"

static void check_sums(struct tally *tally, const struct solved *solved, int band)
{
	for (int i = 0; i <= 48; i++)
		for (int zenith = 0; zenith <= 85; zenith += 5) {
			const double tau = 0.01 * pow(500 / 0.01, i / 48.0);
			const struct slab_flux flux = slab_flux_at(solved->slab, band, tau, cos(zenith * DEGREE));
			tally_add(tally, fabs(flux.reflected + flux.transmitted - 1), "tau %.3g, sun at %d deg, gamma %.3g, re %.3g um",
				  tau, zenith, solved->dsd.gamma, solved->dsd.effective_radius_um);
		}
}

/* All pairs of zenith angles at some depths, each with an azimuth at random. */
static void check_exchange(struct tally *tally, const struct solved *solved, int band)
{
	for (int i = 0; i < 12; i++)
		for (int here = 0; here <= 85; here += 5)
			for (int there = 0; there < here; there += 5) {
				const double tau = 0.01 * pow(500 / 0.01, i / 11.0), azimuth = M_PI * random_unit();
				const double mu = cos(here * DEGREE), nu = cos(there * DEGREE);
				const enum slab_side side = random_unit() < 0.5 ? SLAB_REFLECTED : SLAB_TRANSMITTED;
				const double one = slab_radiance(solved->slab, solved->optics, band, side, tau, mu, nu, azimuth) / mu;
				const double other = slab_radiance(solved->slab, solved->optics, band, side, tau, nu, mu, azimuth) / nu;
				tally_add(tally, fabs(one / other - 1), "tau %.3g, sun at %d, view at %d deg, gamma %.3g, re %.3g um", tau,
					  here, there, solved->dsd.gamma, solved->dsd.effective_radius_um);
			}
}

void validate_conservation(struct validation *validation)
{
	struct tally *tally = validation->measured.tally;
	for (int i = 0, count = effort_count(validation, 40); i < count; i++) {
		struct solved solved = solved_init(validation, droplets_at(i));
		for (int band = 0; band < BAND_COUNT; band++) {
			check_sums(&tally[TALLY_CONSERVATION], &solved, band);
			check_exchange(&tally[TALLY_RECIPROCITY], &solved, band);
			/* Before the solver averaged what reciprocity makes equal. */
			tally_add(&tally[TALLY_RECIPROCITY], solved.slab->band[band].asymmetry, "transposed elements of the solver");
		}
		solved_finish(&solved);
	}
}
