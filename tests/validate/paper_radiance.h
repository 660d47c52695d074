/* Radiance by the paper's form, as the shading "paper" has it (shaders/lib/view.glsl), on the processor and with the parameters fitted to
 * these droplets.
 *
 * Orders 0 to 2 are those of the modified phase function: the forward peak by small-angle Poisson statistics, single scattering by P_S
 * blurred by the peak, double scattering by P_2 in the shape of single scattering with the flux of R_2, T_2; 3 and more are Lambertian.
 */
#ifndef STRATUS_TESTS_VALIDATE_PAPER_RADIANCE_H
#define STRATUS_TESTS_VALIDATE_PAPER_RADIANCE_H

#include "renderer/optics/forward.h"
#include "renderer/optics/paper_fit.h"

/* Radiance for F0 = 1, by orders 0, 1, 2, 3 and more. Conventions of renderer/optics/slab.h; 550 nm. */
struct paper_light {
	double order[4];
};

/* What one layer lit from one side has in common for all views. */
struct paper_layer {
	const struct optics *optics;
	const struct forward_tables *forward;
	double tau, tau_modified, mu_l;
	struct paper_orders orders;
	double scale[SLAB_SIDE_COUNT]; /* of double scattering */
};

struct paper_layer paper_layer_init(const struct optics *optics, const struct forward_tables *forward, const struct paper_fit_table *fit,
				    double thickness_m, double mu_l);

struct paper_light paper_layer_light(const struct paper_layer *layer, enum slab_side side, double mu_v, double azimuth);

#endif
