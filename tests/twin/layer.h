/* A uniform layer for the twin: a flat top, and light of one kind. */
#ifndef STRATUS_TESTS_TWIN_LAYER_H
#define STRATUS_TESTS_TWIN_LAYER_H

#include "renderer/optics/path_tables.h"
#include "tests/twin/twin.h"

/* What is there. Irradiance by the sun is 1 in every band on a plane normal to its beam, or nothing. */
struct layer_case {
	const struct droplet_tables *tables;
	double thickness_m;
	double sun_zenith_deg;
	bool sun;
	double sky, ground_albedo; /* radiance of the sky in every direction; Lambert's ground */
};

struct uniform_layer {
	struct twin twin;
	struct path_inverse *inverse;
	struct path_chains *chains;
	float *phase, *bounds, top[4], black[4], white[4], sky[2][4], ground[4], identity[4];
	struct layer_case is;
	int rounds; /* run so far, each with chains of its own */
};

void layer_init(struct uniform_layer *layer, const struct layer_case *is);
void layer_finish(struct uniform_layer *layer);

/* Mean of a layer of the picture (enum layer) and its standard error, per band, seen from just below or above the layer in a direction that
 * goes up or down; zenith is that of the direction reversed when it goes down. relative_azimuth: between the headings of sun's light and
 * the view's, as in renderer/optics/slab.h. */
struct layer_seen {
	double mean[3], error[3];
};
struct layer_seen layer_see(struct uniform_layer *layer, bool above, double mu_v, double azimuth, int samples, int threads);

/* Irradiance of all that the layer sends up (above) or down through a horizontal plane, likewise. Directions are drawn in cells, one each,
 * that are even in irradiance or in a lobe about the beam; all cells again `replicates` times (at least 2), whose scatter is the error.
 * samples: of all, about. */
struct layer_seen layer_irradiance(struct uniform_layer *layer, bool above, int replicates, int samples, int threads);

#endif
