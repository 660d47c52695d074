/* The radiosity stage: light between the cloud base and the ground (paper, section 5).
 *
 * Both planes are periodic pictures of one tile. Passes on the GPU paint what they send and reflect by themselves; the exchange between
 * them is solved on the processor (renderer/stages/radiosity_solve.h), since so small a picture is done there before a GPU has begun its
 * dozens of passes, and exactly (renderer/stages/exchange.h).
 */
#ifndef STRATUS_RENDERER_STAGES_RADIOSITY_H
#define STRATUS_RENDERER_STAGES_RADIOSITY_H

#include "renderer/stages/field.h"
#include "renderer/stages/ground.h"
#include "renderer/stages/radiosity_solve.h"
#include "renderer/stages/sky.h"
#include "renderer/stages/slab_tables.h"

enum { RADIOSITY_PASS_COUNT = 2 };

struct radiosity_stage {
	struct pass *passes[RADIOSITY_PASS_COUNT];
};

struct radiosity_light {
	const struct texture *ground_received; /* irradiance of the ground by sky and cloud base, W/m2/nm; the beam is not in it */
	const struct texture *cloud_received;  /* irradiance of the cloud base by the ground */
	double ground_diffuse[3];              /* mean of the first */
	double ground_direct[3];               /* mean irradiance of the ground by the beam through the clouds, horizontal */
	int passes;                            /* these three as in radiosity_solve.h */
	double residual, residuals[RADIOSITY_PASSES_LISTED];
};

bool radiosity_stage_init(struct radiosity_stage *stage, const struct pass_compiler *compiler);
void radiosity_stage_finish(struct radiosity_stage *stage);

/* Only for scenes with clouds; wants all stages before it. Fills in the block's air_below. The light stays valid
 * for this frame. false (and a log line) when out of memory. */
bool radiosity_stage_run(const struct radiosity_stage *stage, struct stage_context *context, const struct scene *scene,
			 const struct ground_maps *ground, const struct sky_tables *sky, const struct field_maps *field,
			 const struct texture *slab_rows, struct radiosity_light *light);

#endif
