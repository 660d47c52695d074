/* The bounds of the validation: what was measured, whether it holds, and the table of it.
 *
 * Measurements are tallies of errors, which several bounds may judge: the same values have a root mean square and a worst one. A bound that
 * nothing was measured for is broken, and so is one whose value is not a number.
 */
#ifndef STRATUS_TESTS_VALIDATE_BOUNDS_H
#define STRATUS_TESTS_VALIDATE_BOUNDS_H

#include <stdbool.h>
#include <stdio.h>

enum tally_id {
	TALLY_EXTINCTION, /* against tests/data/mie.json: relative, absolute, absolute, relative, relative */
	TALLY_ASYMMETRY,
	TALLY_PEAK_FRACTION,
	TALLY_PHASE,
	TALLY_PHASE_BACKWARD,
	TALLY_SPHERES_EXTINCTION, /* against sums over single spheres, other droplets: the same */
	TALLY_SPHERES_ASYMMETRY,
	TALLY_SPHERES_PEAK_FRACTION,
	TALLY_SPHERES_PHASE,
	TALLY_SPHERES_PHASE_BACKWARD,
	TALLY_CONSERVATION, /* absolute */
	TALLY_RECIPROCITY,  /* relative */
	TALLY_REFERENCE_FLUX,
	TALLY_REFERENCE_RADIANCE,
	TALLY_LOOKUP,
	TALLY_LOOKUP_FORWARD,
	TALLY_PHOTON_FORWARD,
	TALLY_PHOTON_FLUX, /* over what is allowed */
	TALLY_PHOTON_RADIANCE,
	TALLY_PHOTON_ERROR, /* standard errors of what was judged */
	TALLY_SQUARES,      /* absolute, over the emitter's value */
	TALLY_DECK_GROUND,  /* relative, these four */
	TALLY_DECK_BASE,
	TALLY_DECK_REFERENCE,
	TALLY_DECK_BALANCE,
	TALLY_PUFFED_BALANCE,
	TALLY_WATER_SKY, /* relative */
	TALLY_COLD,      /* ms: least of several, of one distribution */
	TALLY_DISK,
	TALLY_MEMORY,
	TALLY_SKY_ABSOLUTE, /* clear sky, relative: against discrete ordinates; of photons what their error does not explain */
	TALLY_SKY_RELATIVE,
	TALLY_SKY_PHOTONS,
	TALLY_SKY_PHOTONS_RELATIVE,
	TALLY_SKY_COLOUR, /* distance of chromaticities x, y */
	TALLY_SKY_LUMINANCE,
	TALLY_PATHS_LAYER, /* the reference model: over 3 standard errors; relative */
	TALLY_PATHS_FLUX,
	TALLY_PATHS_ERROR,
	TALLY_PATHS_THIN, /* relative, these two */
	TALLY_PATHS_FURNACE,
	TALLY_PATHS_TIME, /* ms */
	TALLY_COUNT
};

/* Of errors >= 0. Zero-initialised. */
struct tally {
	double square, worst;
	long count, within; /* within: errors of at most 1 */
	char where[160];    /* of the worst */
};

struct measurements {
	struct tally tally[TALLY_COUNT];
	bool of_one_part; /* bounds that nothing was measured for belong to the other parts, and are left out */
};

/* format and what follows say where, should this be the worst. An error that is not a number stays the worst. */
void tally_add(struct tally *tally, double error, const char *format, ...) __attribute__((format(printf, 3, 4)));

enum statistic { STATISTIC_WORST, STATISTIC_RMS, STATISTIC_SHARE };

struct bound {
	const char *what;
	enum tally_id tally;
	enum statistic statistic;
	double limit;     /* at most; of a share: at least */
	double tolerance; /* fails the run beyond this many times the limit: 1, of times that a busy machine stretches 2 */
	const char *unit; /* "%" shows it times 100 */
};

enum { BOUND_COUNT = 44 };
extern const struct bound bounds[BOUND_COUNT];

enum verdict { VERDICT_REACHED, VERDICT_TOLERATED, VERDICT_BROKEN };

double bound_value(const struct bound *bound, const struct measurements *measurements);
enum verdict bound_judge(const struct bound *bound, const struct measurements *measurements);

/* Is none broken? */
bool bounds_hold(const struct measurements *measurements);

/* The table, in Markdown. */
void bounds_print(FILE *file, const struct measurements *measurements);

#endif
