/* The density of clouds made of noise: convective cells, rolls, turbulence and mesoscale variation over the tile, all functions of time.
 *
 * Every ingredient drifts at a speed of its own and consists of things that live one after the other; where in its life each is follows
 * from time_s in double precision, so that any time costs the same and is as smooth as any other.
 */
#ifndef STRATUS_RENDERER_STAGES_FIELD_NOISE_H
#define STRATUS_RENDERER_STAGES_FIELD_NOISE_H

#include "renderer/stages/stage.h"

enum { FIELD_NOISE_PASS_COUNT = 7, FIELD_DETAIL_SIDE = 512 };

struct field_noise {
	struct pass *passes[FIELD_NOISE_PASS_COUNT];
};

/* How density becomes thickness. */
struct field_noise_profile {
	double roundness;     /* n of H = 1 - (1 - x)^n of the density above its threshold, x 0..1 */
	double skirt;         /* share of the range of densities over which clouds are thin at their edges */
	double overcast_lift; /* share of the range by which the threshold sinks below all densities as coverage reaches 1 */
};

bool field_noise_init(struct field_noise *noise, const struct pass_compiler *compiler);
void field_noise_finish(struct field_noise *noise);

struct field_noise_profile field_noise_profile_of(enum cloud_type type);

/* Fills in the block's cloud_field, cloud_drift and cloud_detail. */
void field_noise_fill_block(struct scene_block *block, const struct scene_clouds *clouds);

/* Fills level 0 of the field and of its detail, as the block, which the passes must see, says. false when out of memory, or
 * stopped. */
bool field_noise_run(const struct field_noise *noise, struct stage_context *context, const struct scene_clouds *clouds,
		     struct texture *coarse, struct texture *detail);

#endif
