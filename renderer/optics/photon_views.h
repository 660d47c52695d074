/* Radiance by local estimates towards many directions. Private to renderer/optics.
 *
 * The plain local estimate P(Theta)/(4 pi) exp(-path/mu_v) is exact but useless for large droplets: P reaches 1e5 in the forward peak, so
 * that one photon in 1e5 carries half of the radiance. Here the last scatterings by the peak, those after a photon's last turn by more
 * than 5 degrees, are followed from the viewer's end: for every photon and view a ray is traced backwards into the layer. It ends where it
 * would be scattered out of the peak, and turns where it is scattered inside it. Wherever a photon is scattered while a leg of the ray
 * passes its level, the light that it sends into that leg, P(Theta)/(4 pi |mu of the leg|) outside of the peak, reaches the viewer. This is
 * the same sum over paths, ordered by their last wide turn; the largest P left is that at 5 degrees, 10 to 80. Paths that have no wide turn
 * at all are light of the aureole: photons that were not turned yet add the plain estimate by the peak alone.
 *
 * Every direction is estimated together with its mirror image in the sun's vertical plane, and rays of one view serve all azimuths.
 */
#ifndef STRATUS_RENDERER_OPTICS_PHOTON_VIEWS_H
#define STRATUS_RENDERER_OPTICS_PHOTON_VIEWS_H

#include "renderer/optics/photon_phase.h"

struct photon_views;

/* For one thread. tau: depth of the layer for the phase function that is tabulated. mu[view_count] is clamped to 1e-3..1,
 * azimuth[azimuth_count] radians, both read now alone; phase must outlive it. order_count: how many numbers of scatterings are told apart,
 * from 1. NULL (and a log line) when out of memory. */
struct photon_views *photon_views_create(const struct photon_phase *phase, double tau, int view_count, const double *mu, int azimuth_count,
					 const double *azimuth, int order_count);
void photon_views_destroy(struct photon_views *views);

/* Traces the rays for the next photon. */
void photon_views_aim(struct photon_views *views, struct photon_random *random);

/* Adds what a photon at a depth (downward, 0..tau) with a direction (x: heading of the sun's light, z downward) scatters. straight: it was
 * never turned by more than the peak's 5 degrees. order: this is its order'th scattering. Returns how many estimates that took. */
int photon_views_scatter(struct photon_views *views, double depth, const double direction[3], bool straight, int order);

/* Ends a photon: adds its estimates to sum and their squares to square, [side][view][azimuth], and by the number of scatterings to
 * order_sum [order][side][view][azimuth], the last order for all that follow (NULL: not), and forgets them. */
void photon_views_collect(struct photon_views *views, double *sum, double *square, double *order_sum);

#endif
