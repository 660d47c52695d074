/* What a photon draws: random numbers, scattering angles and new directions. Private to renderer/optics.
 *
 * P is tabulated once over three zones, each in even steps of the sine or cosine of half the angle: the forward peak F of 5 degrees, what
 * is left of the front, and the back. Within a step P is linear in the square, that is, in the cosine of the angle, so that its
 * distribution is inverted by one square root. The table is normalised by its own sum: directions are drawn from exactly the density that
 * is looked up.
 */
#ifndef STRATUS_RENDERER_OPTICS_PHOTON_PHASE_H
#define STRATUS_RENDERER_OPTICS_PHOTON_PHASE_H

#include "renderer/optics/slab.h"

#include <math.h>
#include <stdint.h>

/* xoshiro256** (D. Blackman and S. Vigna 2021, ACM Trans. Math. Softw. 47, 36). */
struct photon_random {
	uint64_t state[4];
};

/* A stream of its own for every pair of seed and number, by splitmix64. */
void photon_random_start(struct photon_random *random, uint64_t seed, uint64_t number);

static inline uint64_t photon_rotate(uint64_t x, int bits)
{
	return x << bits | x >> (64 - bits);
}

/* Uniform, never 0 and never 1. */
static inline double photon_random_unit(struct photon_random *random)
{
	uint64_t *s = random->state, result = photon_rotate(s[1] * 5, 7) * 9, shifted = s[1] << 17;
	s[2] ^= s[0];
	s[3] ^= s[1];
	s[1] ^= s[2];
	s[0] ^= s[3];
	s[2] ^= shifted;
	s[3] = photon_rotate(s[3], 45);
	return ((double)(result >> 12) + 0.5) * 0x1p-52;
}

/* Optical length of a free path. */
static inline double photon_random_path(struct photon_random *random)
{
	return -log(photon_random_unit(random));
}

enum photon_zone { PHOTON_PEAK, PHOTON_FRONT, PHOTON_BACK, PHOTON_ZONE_COUNT };

enum {
	PHOTON_ZONE_BINS = 8192, /* steps of 0.0006 degrees in the peak, 0.01 outside */
	PHOTON_GUIDE_CELLS = 1 << 14,
	/* Of the table without the peak: nothing inside, then the front, then the back. Each has a spare, for angles rounded beyond its
	   end. */
	PHOTON_BODY_FRONT = 1,
	PHOTON_BODY_BACK = PHOTON_BODY_FRONT + PHOTON_ZONE_BINS + 1,
	PHOTON_BODY_COUNT = PHOTON_BODY_BACK + PHOTON_ZONE_BINS + 1
};

/* P in a bin: offset + slope times the square of the sine (of the cosine in the back) of half the angle. */
struct photon_line {
	float offset, slope;
};

/* Read-only once filled. */
struct photon_phase {
	/* Sine or cosine of half the angle at a zone's start, and the step of its bins. */
	double start[PHOTON_ZONE_COUNT], step[PHOTON_ZONE_COUNT];
	double value[PHOTON_ZONE_COUNT][PHOTON_ZONE_BINS + 1];    /* P */
	double below[PHOTON_ZONE_COUNT * PHOTON_ZONE_BINS + 1];   /* probability of all bins before, in the order of zones */
	uint16_t guide[PHOTON_GUIDE_CELLS];                       /* bin that holds the probability at the start of the cell */
	struct photon_line peak[PHOTON_ZONE_BINS + 1];            /* P inside the peak, with a spare */
	struct photon_line body[PHOTON_BODY_COUNT];               /* P without the peak */
	float edge, peak_per_step, front_per_step, back_per_step; /* start of the front, bins per sine or cosine */
};

/* Tabulates P, or P_S; a millisecond. */
void photon_phase_fill(struct photon_phase *phase, const struct optics *optics, int band, enum slab_phase which);

/* A drawn angle; is it inside the forward peak? */
struct photon_angle {
	double cosine, sine;
	bool peak;
};
struct photon_angle photon_phase_draw(const struct photon_phase *phase, struct photon_random *random);

/* Turns a unit vector by the angle, about itself at random; it stays one over any number of turns. */
void photon_turn(double direction[3], struct photon_angle angle, struct photon_random *random);

#endif
