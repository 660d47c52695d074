/* What pictures of the model reference may cost, and what follows from how they end. Any thread. */
#ifndef STRATUS_SERVER_REFERENCE_LIMITS_H
#define STRATUS_SERVER_REFERENCE_LIMITS_H

#include "server/config.h"
#include "server/problem.h"

/* Adds to the problem what speaks against the price of a valid scene's picture: its light paths, width x height x samples. */
void reference_limits_check(const struct config *config, const struct scene *scene, struct problem *problem);

/* Does the picture depend on how fast it is made? Then it has no entity tag. */
bool reference_is_timed(const struct scene *scene);

/* When a picture that may end early is to stop gathering light, so that what there is can be answered by the deadline; the deadline itself
 * for all others. Both on the clock of clock.h, as now_ms. after_ms: what else is to be done with the picture. */
double reference_stop_ms(const struct scene *scene, double now_ms, double deadline_ms, double after_ms);

#endif
