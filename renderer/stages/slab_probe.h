/* The view's look-ups of the solved slab at any places, read back: to be held against the solver (tests, validation). No part of a frame.
 */
#ifndef STRATUS_RENDERER_STAGES_SLAB_PROBE_H
#define STRATUS_RENDERER_STAGES_SLAB_PROBE_H

#include "renderer/stages/slab_tables.h"

/* The tables of a scene's frame. */
struct slab_probe_frame {
	const struct droplets *droplets;
	const struct texture *slices;
	bool lit[2];              /* top, base */
	double mu_first, mu_last; /* cosines of the sun that the slices reach over */
};

struct slab_probe {
	double thickness_m, mu_l, mu_v; /* mu_l within the frame's range */
	double azimuth;                 /* as in renderer/optics/slab.h */
};

struct slab_probe_light {
	double first[BAND_COUNT], multiple[BAND_COUNT]; /* radiance for F0 = 1 */
};

/* Makes the tables that a frame of this scene (shading solved) would use. false (and a log line) when out of memory. */
bool slab_probe_prepare(struct stage_context *context, const struct scene *scene, struct slab_probe_frame *frame);

/* Runs the shader over `count` probes on what the viewer sees of the layer lit from the top or the base. false when out of memory or when
 * the frame lacks that side. */
bool slab_probe_run(const struct pass_compiler *compiler, const struct slab_probe_frame *frame, const struct scene *scene, bool base,
		    const struct slab_probe *probes, int count, struct slab_probe_light *light);

#endif
