/* Measures what the bounds of docs/validation/README.md judge, and writes that page and the data of its figures.
 *
 * stratus-validate [--kernel FILE] [--effort 0.01..1] [--only PART] FOLDER
 * The page goes to FOLDER/README.md, data beside it; the folder is made unless it is there. Exit status 0: no bound is broken, 1: one is,
 * 2: it could not be measured.
 */
#include "tests/validate/validate.h"

#include "renderer/log.h"

#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

void require(bool holds, const char *what)
{
	if (holds)
		return;
	fprintf(stderr, "validate: %s\n", what);
	exit(2);
}

double random_unit(void)
{
	static uint64_t state = 2006;
	state = state * 6364136223846793005ULL + 1442695040888963407ULL;
	return (double)(state >> 11) * 0x1p-53;
}

int effort_count(const struct validation *validation, int most)
{
	return (int)fmax(1, round(validation->effort * most));
}

/* Of the whole range, its edges included more often than chance would have it. */
static double random_between(double low, double high)
{
	double unit = random_unit();
	return unit < 0.1 ? low : unit > 0.9 ? high : low * pow(high / low, (unit - 0.1) / 0.8);
}

struct scene_dsd droplets_at(int number)
{
	static const double corners[4][2] = {{1, 1}, {1, 30}, {20, 1}, {20, 30}};
	if (number < 4)
		return (struct scene_dsd){10, corners[number][0], corners[number][1]};
	struct scene_dsd dsd;
	do
		dsd = (struct scene_dsd){random_between(1, 5000), random_between(1, 20), random_between(1, 30)};
	while (scene_dsd_liquid_water(&dsd) > 5);
	return dsd;
}

struct solved solved_init(const struct validation *validation, struct scene_dsd dsd)
{
	struct solved solved = {.dsd = dsd, .optics = optics_create(validation->kernel, &dsd, OPTICS_MIE)};
	require(solved.optics, "no optics");
	solved.slab = slab_solve(solved.optics, 2);
	require(solved.slab, "no solution");
	return solved;
}

void solved_finish(struct solved *solved)
{
	slab_destroy(solved->slab);
	optics_destroy(solved->optics);
}

double scattering_cosine(enum slab_side side, double mu_l, double mu_v, double azimuth)
{
	const double along = side == SLAB_TRANSMITTED ? mu_l * mu_v : -mu_l * mu_v;
	return fmin(fmax(along + sqrt((1 - mu_l * mu_l) * (1 - mu_v * mu_v)) * cos(azimuth), -1), 1);
}

FILE *figure_file(const struct validation *validation, const char *name)
{
	char path[4096];
	snprintf(path, sizeof path, "%s/%s.tsv", validation->folder, name);
	FILE *file = fopen(path, "w");
	require(file, "cannot write the figures' data");
	return file;
}

/* Before hours of work are spent on what could not be written. */
static void require_folder(const struct validation *validation)
{
	const bool made = mkdir(validation->folder, 0777) == 0 || errno == EEXIST;
	require(made && access(validation->folder, W_OK | X_OK) == 0, "the folder cannot be written to");
}

/* --- the run ------------------------------------------------------------------------------------------------------------------- */

static const struct part {
	const char *name;
	void (*run)(struct validation *validation);
} parts[] = {
	/* Times first, while nothing else of this program has filled the caches. */
	{"times", validate_times},
	{"data", validate_reference},
	{"reference", validate_paths},
	{"spheres", validate_spheres},
	{"conservation", validate_conservation},
	{"lookup", validate_lookup},
	{"photons", validate_photons},
	{"sky", validate_sky},
	{"ground", validate_ground},
	{"figure 4", figure_phase},
	{"figure 6", figure_orders},
	{"figure 8", figure_fluxes},
	{"figure 9", figure_radiance},
	{"passes", figure_passes},
	{"water sky", figure_water_sky},
};

static double now_s(void)
{
	struct timespec now;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void run_parts(struct validation *validation)
{
	for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
		if (validation->only && strcmp(parts[i].name, validation->only) != 0)
			continue;
		double start = now_s();
		fprintf(stderr, "validate: %s", parts[i].name);
		parts[i].run(validation);
		fprintf(stderr, ", %.1f s\n", now_s() - start);
	}
}

static void print_head(FILE *file, const struct validation *validation)
{
	fprintf(file, "# Validation\n\n"
		      "Written by `make validate`, which measures all of this anew, draws the figures and fails when a bound is broken. "
		      "Everything but the\n"
		      "times is the same in every run on one kind of processor.\n\n");
	if (validation->effort != 1)
		fprintf(file, "**A run of effort %g: too short for the bounds.**\n\n", validation->effort);
	fprintf(file, "The clear sky has a page of its own, [sky.md](sky.md).\n\n");
	fprintf(file, "## Bounds\n\n");
	bounds_print(file, &validation->measured);
	fprintf(file, "\nHow:\n\n"
		      "- Droplets: the paper's, the corners of gamma 1 to 20 and re 1 to 30 um, and others at random over that range, in "
		      "all three "
		      "bands.\n"
		      "- `tests/data` holds the paper's droplets alone. For others kappa, asymmetry and P are held against straight sums "
		      "over single "
		      "spheres, which\n"
		      "  share the Mie series with the code but neither its table nor its quadrature.\n"
		      "- R + T and reciprocity: every 5 degrees of sun to 85, tau 0.01 to 500. Reciprocity counts the solver's matrices "
		      "before it "
		      "averages what must be\n"
		      "  equal.\n");
}

static void write_page(struct validation *validation, const char *figures)
{
	char path[4096];
	snprintf(path, sizeof path, "%s/README.md", validation->folder);
	FILE *file = fopen(path, "w");
	require(file, "cannot write the page");
	print_head(file, validation);
	fputs(figures, file);
	require(fclose(file) == 0, "cannot write the page");
}

static bool parse(struct validation *validation, const char **kernel, int argc, char **argv)
{
	for (int i = 1; i < argc; i++)
		if (strcmp(argv[i], "--kernel") == 0 && i + 1 < argc)
			*kernel = argv[++i];
		else if (strcmp(argv[i], "--effort") == 0 && i + 1 < argc)
			validation->effort = atof(argv[++i]);
		else if (strcmp(argv[i], "--only") == 0 && i + 1 < argc)
			validation->only = argv[++i];
		else if (argv[i][0] != '-' && !validation->folder)
			validation->folder = argv[i];
		else
			return false;
	return validation->folder && validation->effort >= 0.01 && validation->effort <= 1;
}

int main(int argc, char **argv)
{
	static struct validation validation = {.effort = 1};
	const char *kernel = "build/mie.kernel";
	require(parse(&validation, &kernel, argc, argv), "usage: stratus-validate [--kernel FILE] [--effort 0.01..1] [--only PART] FOLDER");
	require_folder(&validation);
	log_set_level(LOG_ERROR);
	validation.measured.of_one_part = validation.only;
	validation.kernel = kernel_load(kernel);
	require(validation.kernel, "no kernel table");
	char *figures = NULL;
	size_t size = 0;
	validation.page = open_memstream(&figures, &size);
	require(validation.page, "out of memory");
	run_parts(&validation);
	fclose(validation.page);
	write_page(&validation, figures);
	bounds_print(stdout, &validation.measured);
	free(figures);
	kernel_destroy(validation.kernel);
	const bool hold = bounds_hold(&validation.measured);
	const char *which = validation.only ? "the bounds of this part hold" : "all bounds hold";
	puts(hold ? which : "A BOUND IS BROKEN, or nothing was measured");
	return hold ? 0 : 1;
}
