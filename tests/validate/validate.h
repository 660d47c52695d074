/* What the parts of the validation share. They measure, each a few rows of the table of bounds (tests/validate/bounds.h), and write the
 * data of the figures. Seeds are fixed; what the machine cannot do ends the program.
 */
#ifndef STRATUS_TESTS_VALIDATE_VALIDATE_H
#define STRATUS_TESTS_VALIDATE_VALIDATE_H

#include "renderer/optics/kernel.h"
#include "renderer/optics/paper_fit.h"
#include "renderer/optics/slab_photons.h"
#include "tests/validate/bounds.h"

#include <math.h>

#define DEGREE (M_PI / 180)

/* The distribution of the paper, of tests/data and of the figures. */
#define PAPER_DROPLETS ((struct scene_dsd){300, 2, 7})

struct validation {
	struct kernel *kernel;
	double effort;      /* 1: the full run; less: as many photons, distributions and probes fewer, which the bounds were not made for */
	const char *only;   /* the one part to run, NULL: all; what is not measured counts as broken */
	const char *folder; /* for the figures' data */
	struct measurements measured;
	FILE *page; /* the figures' text, as the parts have it to say */
};

/* Ends the program with a line on standard error unless it holds. */
void require(bool holds, const char *what);

/* 0..1, the same in every run. */
double random_unit(void);

/* Of `most` at full effort, at least 1. */
int effort_count(const struct validation *validation, int most);

/* Any droplets that a request may name, the first four the corners of gamma and effective radius; numbered from 0. */
struct scene_dsd droplets_at(int number);

/* Droplets with their solution. */
struct solved {
	struct scene_dsd dsd;
	struct optics *optics;
	struct slab_solution *slab;
};
struct solved solved_init(const struct validation *validation, struct scene_dsd dsd);
void solved_finish(struct solved *solved);

/* Cosine of the angle between the light before and after. */
double scattering_cosine(enum slab_side side, double mu_l, double mu_v, double azimuth);

/* --- the parts ------------------------------------------------------------------------------------------------------------------- */

void validate_reference(struct validation *validation);    /* tests/data */
void validate_spheres(struct validation *validation);      /* sums over single spheres */
void validate_conservation(struct validation *validation); /* R + T = 1, reciprocity */
void validate_lookup(struct validation *validation);       /* the shader */
void validate_photons(struct validation *validation);      /* Monte Carlo */
void validate_ground(struct validation *validation);       /* light between ground and clouds */
void validate_sky(struct validation *validation);          /* the clear sky; writes the page sky.md */
void validate_paths(struct validation *validation);        /* the reference model */
void validate_times(struct validation *validation);        /* the store */

/* The paper's figures: data files in the folder, text onto the page. */
void figure_phase(struct validation *validation);
void figure_orders(struct validation *validation);
void figure_fluxes(struct validation *validation);
void figure_radiance(struct validation *validation);
/* None of the paper's. */
void figure_passes(struct validation *validation);
void figure_water_sky(struct validation *validation);

/* Opens a data file. */
FILE *figure_file(const struct validation *validation, const char *name);

#endif
