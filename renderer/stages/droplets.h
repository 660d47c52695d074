/* The optics stage: droplets to tables on the GPU. Processor work, no passes.
 *
 * Two results, since they change at different times: what the droplets scatter (phase functions, forward peak), and what a slab of them
 * does with sunlight at one elevation (orders of scattering over thickness).
 */
#ifndef STRATUS_RENDERER_STAGES_DROPLETS_H
#define STRATUS_RENDERER_STAGES_DROPLETS_H

#include "renderer/optics/optics.h"
#include "renderer/stages/stage.h"

enum { PHASE_TABLE_WIDTH = 2048, SLAB_SUN_WIDTH = 256, SLAB_SUN_ROWS = 6, SLAB_VIEW_SIZE = 64 };

/* Thickness (m, of appendix B's droplets) at the end of the view table. */
#define SLAB_VIEW_THICKNESS_M 4000.0

struct droplets {
	struct optics *optics;
	struct texture phase, forward_peak, forward_blur;
};

struct slab_tables {
	struct texture sun;  /* columns: square root of H over its maximum; rows: T_3+, scale of I2_t, R_3+, scale of I2_r, T_0+1+2,
				spherical albedo */
	struct texture view; /* T_ms over square root of H and zenith angle of view */
};

/* Both owned by the cache and valid for this frame. NULL (and a log line) when out of memory. Fills the block's extinctions. */
const struct droplets *droplets_get(struct stage_context *context, const struct scene *scene);
const struct slab_tables *slab_tables_get(struct stage_context *context, const struct scene *scene, const struct droplets *droplets);

#endif
