#include "renderer/optics/path_tables.h"

#include "renderer/optics/photon_phase.h"
#include "renderer/sun_disc.h"

/* Steps of the integral within a column of the phase table. */
enum { STEPS = 16, CELLS = (DROPLET_PHASE_COLUMNS - 1) * STEPS };

/* P as shaders/lib/optics.glsl looks it up. */
static double phase_at(const struct droplet_tables *tables, int band, double unit)
{
	const double at = unit * (DROPLET_PHASE_COLUMNS - 1);
	const int column = (int)fmin(at, DROPLET_PHASE_COLUMNS - 2);
	const double low = tables->phase[0][column][band], high = tables->phase[0][column + 1][band];
	return exp2(low + (at - column) * (high - low));
}

/* Square of the sine of half the angle: P is a density in it. */
static double square_of(double unit)
{
	return unit < 0.5 ? 2 * unit * unit : 1 - 2 * (1 - unit) * (1 - unit);
}

/* Shares below the ends of all steps, up to 1. */
static void integrate(const struct droplet_tables *tables, int band, double below[CELLS + 1])
{
	below[0] = 0;
	for (int i = 0; i < CELLS; i++) {
		const double low = (double)i / CELLS, high = (double)(i + 1) / CELLS;
		below[i + 1] = below[i] + phase_at(tables, band, 0.5 * (low + high)) * (square_of(high) - square_of(low));
	}
	for (int i = 1; i <= CELLS; i++)
		below[i] /= below[CELLS];
}

/* Within a step the square grows evenly. */
static double unit_below(const double below[CELLS + 1], int cell, double share)
{
	const double low = (double)cell / CELLS, high = (double)(cell + 1) / CELLS, width = below[cell + 1] - below[cell];
	const double t = width > 0 ? (share - below[cell]) / width : 0;
	const double square = square_of(low) + t * (square_of(high) - square_of(low));
	return square < 0.5 ? sqrt(0.5 * square) : 1 - sqrt(0.5 * (1 - square));
}

void path_inverse_fill(struct path_inverse *inverse, const struct droplet_tables *tables)
{
	static _Thread_local double below[CELLS + 1];
	for (int band = 0; band < BAND_COUNT; band++) {
		integrate(tables, band, below);
		for (int i = 0, cell = 0; i < PATH_INVERSE_COLUMNS; i++) {
			const double share = (double)i / (PATH_INVERSE_COLUMNS - 1);
			while (cell < CELLS - 1 && below[cell + 1] < share)
				cell++;
			inverse->unit[i][band] = (float)unit_below(below, cell, share);
		}
	}
	for (int i = 0; i < PATH_INVERSE_COLUMNS; i++)
		inverse->unit[i][3] = 0;
}

/* --- chains -------------------------------------------------------------------------------------------------------------------- */

/* The forward peak's part of the distribution, finely. */
struct peak {
	double below[CELLS + 1];
	int last; /* cell that the peak ends in */
	double share;
};

static void peak_fill(struct peak *peak, const struct droplet_tables *tables, int band)
{
	const double edge = sin(FORWARD_PEAK_ANGLE / 2) * M_SQRT1_2 * CELLS;
	integrate(tables, band, peak->below);
	peak->last = (int)edge;
	const double low = square_of((double)peak->last / CELLS), high = square_of((double)(peak->last + 1) / CELLS);
	const double within = (square_of(edge / CELLS) - low) / (high - low);
	peak->share = peak->below[peak->last] + within * (peak->below[peak->last + 1] - peak->below[peak->last]);
}

static double peak_draw(const struct peak *peak, struct photon_random *random)
{
	const double share = peak->share * photon_random_unit(random);
	int low = 0, high = peak->last;
	while (low < high) {
		const int middle = (low + high) / 2;
		if (peak->below[middle + 1] < share)
			low = middle + 1;
		else
			high = middle;
	}
	return unit_below(peak->below, low, share);
}

/* A point of the disc, as bright as the limb lets it be: 1 - u + u cos, half of whose light is even over the disc when u = 0.6. */
static void disc_draw(double direction[3], double radius, struct photon_random *random)
{
	const double dark = SUN_LIMB_DARKENING, even = (1 - dark) / (1 - dark / 3);
	const double which = photon_random_unit(random), u = photon_random_unit(random), around = 2 * M_PI * photon_random_unit(random);
	const double square = which < even ? u : 1 - pow(u, 2.0 / 3);
	const double sine = sin(radius * sqrt(square));
	direction[0] = sine * cos(around);
	direction[1] = sine * sin(around);
	direction[2] = sqrt(1 - sine * sine);
}

static void chain_draw(float chain[PATH_CHAIN_LENGTH][4], const struct droplet_tables *tables, const struct peak *peak, int hero,
		       double radius, struct photon_random *random)
{
	double direction[3], ratio[2] = {1, 1};
	disc_draw(direction, radius, random);
	for (int i = 0; i < PATH_CHAIN_LENGTH; i++) {
		if (i > 0) {
			const double unit = peak_draw(peak, random), square = square_of(unit);
			const double own = tables->optics->extinction_per_m[hero] * phase_at(tables, hero, unit);
			photon_turn(direction, (struct photon_angle){1 - 2 * square, 2 * sqrt(square * (1 - square)), true}, random);
			for (int k = 0; k < 2; k++) {
				const int band = (hero + 1 + k) % BAND_COUNT;
				ratio[k] *= tables->optics->extinction_per_m[band] * phase_at(tables, band, unit) / own;
			}
		}
		chain[i][0] = (float)direction[0];
		chain[i][1] = (float)direction[1];
		chain[i][2] = (float)ratio[0];
		chain[i][3] = (float)ratio[1];
	}
}

void path_chains_draw(struct path_chains *chains, const struct droplet_tables *tables, double radius, uint64_t seed, uint64_t number)
{
	static _Thread_local struct peak peak;
	struct photon_random random;
	photon_random_start(&random, seed, number);
	for (int hero = 0; hero < BAND_COUNT; hero++) {
		peak_fill(&peak, tables, hero);
		for (int row = 0; row < PATH_CHAIN_ROWS; row++)
			for (int i = 0; i < PATH_CHAINS_A_ROW; i++)
				chain_draw(chains->chain[hero][row][i], tables, &peak, hero, radius, &random);
	}
}
