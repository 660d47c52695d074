/* Optical properties of droplets, as /v1/optics answers them, for people. */
#ifndef STRATUS_CLIENTS_OPTICS_TEXT_H
#define STRATUS_CLIENTS_OPTICS_TEXT_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* Is it what /v1/optics answers, with three bands? */
bool optics_is_whole(const json_t *optics);

/* Properties by bands, and the phase function at some angles. */
void optics_print_table(FILE *to, const json_t *optics);

/* The phase function of the middle band over the scattering angle, in characters. */
void optics_print_curve(FILE *to, const json_t *optics);

/* The phase function of all bands, as a figure. An enum client_exit. */
int optics_draw(const json_t *optics, const char *path);

#endif
