/* Figure 8: fluxes by orders of scattering over the thickness, of photons, of the paper's form fitted, and of the solver. */
#include "tests/validate/validate.h"

enum { BAND = 1, CURVE = 121, DOTS = 13, ORDERS = 4 };

#define ZENITH (30 * DEGREE)

/* 1 to 1000 m. */
static double thickness_at(int i, int count)
{
	return pow(1000, (double)i / (count - 1));
}

/* T of orders 0 to 3+, then R of 1 to 3+. */
static double order_of(const double t[ORDERS], const double r[ORDERS], int k)
{
	return k < ORDERS ? t[k] : r[k - ORDERS + 1];
}

enum { QUANTITIES = 2 * ORDERS - 1 };
static const char *const names[QUANTITIES] = {"T0", "T1", "T2", "T3+", "R1", "R2", "R3+"};

/* At one thickness by all three. */
struct sample {
	double solved[QUANTITIES], paper[QUANTITIES], photons[QUANTITIES], error[QUANTITIES];
};

static void sample_forms(struct sample *sample, const struct optics *optics, const struct paper_fit_table *table, double thickness)
{
	const double mu_l = cos(ZENITH), tau = thickness * optics->extinction_per_m[BAND];
	const struct slab_orders solved = slab_orders_at(optics, BAND, SLAB_PHASE_MODIFIED, tau, mu_l);
	const struct paper_fit fit = paper_fit_table_at(table, ZENITH);
	const struct paper_orders paper = paper_orders_at(&fit, thickness, thickness * table->extinction_modified_per_m / mu_l);
	for (int k = 0; k < QUANTITIES; k++) {
		sample->solved[k] = order_of(solved.t, solved.r, k);
		sample->paper[k] = order_of(paper.t, paper.r, k);
	}
}

static void sample_photons(const struct validation *validation, struct sample *sample, const struct optics *optics, double thickness)
{
	struct photon_params params = {.optics = optics, .band = BAND, .phase = SLAB_PHASE_MODIFIED, .seed = 8, .threads = 2};
	params.tau = thickness * optics->extinction_per_m[BAND];
	params.mu_l = cos(ZENITH);
	params.photons = (uint64_t)effort_count(validation, 1000000);
	struct photon_result result;
	require(slab_photons_trace(&params, &result), "photons cannot be traced");
	for (int k = 0; k < QUANTITIES; k++) {
		sample->photons[k] = order_of(result.orders.t, result.orders.r, k);
		sample->error[k] = order_of(result.orders_error.t, result.orders_error.r, k);
	}
	photon_result_finish(&result);
}

static void write_values(FILE *file, double thickness, const double *values)
{
	fprintf(file, "%.5g", thickness);
	for (int k = 0; k < QUANTITIES; k++)
		fprintf(file, "\t%.5g", values[k]);
}

static void write_curves(const struct validation *validation, const struct optics *optics, const struct paper_fit_table *table)
{
	FILE *file = figure_file(validation, "figure8");
	fprintf(file, "# H in m, solved T0 T1 T2 T3+ R1 R2 R3+, the paper's form the same\n");
	for (int i = 0; i < CURVE; i++) {
		struct sample sample;
		const double thickness = thickness_at(i, CURVE);
		sample_forms(&sample, optics, table, thickness);
		write_values(file, thickness, sample.solved);
		for (int k = 0; k < QUANTITIES; k++)
			fprintf(file, "\t%.5g", sample.paper[k]);
		fprintf(file, "\n");
	}
	fclose(file);
}

static void print_row(FILE *page, double thickness, const struct sample *sample)
{
	fprintf(page, "| %.4g |", thickness);
	for (int k = 0; k < QUANTITIES; k++)
		fprintf(page, " %.4f / %.4f / %.4f |", sample->photons[k], sample->solved[k], sample->paper[k]);
	fprintf(page, "\n");
}

static void describe_head(FILE *page)
{
	fprintf(page,
		"\n## Figure 8: fluxes by orders over the thickness\n\n![Fluxes by orders](figure8.svg)\n\n"
		"Modified phase function, sun 30 degrees from the vertical, 550 nm, fractions of the incident flux. Dots: photons. Lines: "
		"solver. Pale bands:\nthe paper's form (appendix A) fitted to these droplets. The table has photons / solver / form.\n\n| "
		"H in "
		"m |");
	for (int k = 0; k < QUANTITIES; k++)
		fprintf(page, " %s |", names[k]);
	fprintf(page, "\n| --- | --- | --- | --- | --- | --- | --- | --- |\n");
}

void figure_fluxes(struct validation *validation)
{
	struct solved solved = solved_init(validation, PAPER_DROPLETS);
	struct paper_fit_table table;
	double paper = 0, worst = 0, error = 0;
	require(paper_fit_table_compute(solved.optics, solved.slab, 2, &table), "no fit");
	write_curves(validation, solved.optics, &table);
	FILE *file = figure_file(validation, "figure8dots");
	fprintf(file, "# H in m, photons T0 T1 T2 T3+ R1 R2 R3+\n");
	describe_head(validation->page);
	for (int i = 0; i < DOTS; i++) {
		struct sample sample;
		const double thickness = thickness_at(i, DOTS);
		sample_forms(&sample, solved.optics, &table, thickness);
		sample_photons(validation, &sample, solved.optics, thickness);
		write_values(file, thickness, sample.photons);
		fprintf(file, "\n");
		for (int k = 0; k < QUANTITIES; k++) {
			paper = fmax(paper, fabs(sample.paper[k] - sample.photons[k]));
			worst = fmax(worst, fabs(sample.solved[k] - sample.photons[k]));
			error = fmax(error, sample.error[k]);
		}
		print_row(validation->page, thickness, &sample);
	}
	fclose(file);
	fprintf(validation->page,
		"\nThe largest standard error is %.4f. The solver is within %.4f of the photons. The form is within %.4f, near perfect as "
		"the paper "
		"says, but in\n"
		"thin layers most of what it has of R2 and R3+ is error, which the logarithmic scale shows.\n"
		"[paper-fit.md](paper-fit.md) has all incidences, and where the form ends.\n",
		error, worst, paper);
	solved_finish(&solved);
}
