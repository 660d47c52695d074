/* What the light paths of the reference model draw from (shaders/lib/light_path.glsl): scattering angles, and chains of forward scatterings
 * that end in the sun's disc. Any thread.
 */
#ifndef STRATUS_RENDERER_OPTICS_PATH_TABLES_H
#define STRATUS_RENDERER_OPTICS_PATH_TABLES_H

#include "renderer/optics/droplet_tables.h"

#include <stdint.h>

enum {
	PATH_INVERSE_COLUMNS = 4096,
	/* As in shaders/lib/light_path_sun.glsl. */
	PATH_CHAIN_LENGTH = 16,
	PATH_CHAINS_A_ROW = 64,
	PATH_CHAIN_ROWS = 64
};

/* Per band the inverse of the share of light that is scattered by less than an angle: angles as units of the phase table's columns, 0
 * forward, 1 backward, for shares even from 0 to 1. */
struct path_inverse {
	float unit[PATH_INVERSE_COLUMNS][4];
};

/* Of the phase function as the phase table's interpolation has it. */
void path_inverse_fill(struct path_inverse *inverse, const struct droplet_tables *tables);

/* Chains for each band as hero. [0] is a direction in the sun's disc, every further one the one before it, turned by a scattering within
 * the forward peak: x and y are its components aside of the middle of the sun; then, of the next two bands in turn, the density of all the
 * chain's scatterings over that of the hero, extinctions included. */
struct path_chains {
	float chain[BAND_COUNT][PATH_CHAIN_ROWS][PATH_CHAINS_A_ROW][PATH_CHAIN_LENGTH][4];
};

/* Draws them; 15 ms. radius: angular radius of the sun, rad. Equal numbers and seeds give equal chains, on any machine of one kind. */
void path_chains_draw(struct path_chains *chains, const struct droplet_tables *tables, double radius, uint64_t seed, uint64_t number);

#endif
