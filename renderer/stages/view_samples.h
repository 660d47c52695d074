/* Several rays a pixel, where pixels are so large that one ray does not stand for them.
 *
 * What a ray sees of the clouds is a mean over what it covers (shaders/lib/field.glsl), but the light of a mean thickness is not the mean
 * of the light: over broken clouds whole panoramas come out several percent wrong where rays are degrees wide. Such pictures are made finer
 * than asked for and averaged, and the rays of panoramas cover less than lies between them, since no mean is wrong by what they leave out.
 */
#ifndef STRATUS_RENDERER_STAGES_VIEW_SAMPLES_H
#define STRATUS_RENDERER_STAGES_VIEW_SAMPLES_H

#include "renderer/gl/pass.h"
#include "renderer/stages/stage.h"

struct camera_view;

struct view_samples_stage {
	struct pass_compiler compiler; /* shader_dir must outlive the stage */
	struct pass *reduce[PROJECTION_COUNT];
};

void view_samples_init(struct view_samples_stage *stage, const struct pass_compiler *compiler);
void view_samples_finish(struct view_samples_stage *stage);

struct view_samples {
	int per_side;     /* rays a side of a pixel; more than 1 only where the disc is too small for sun_disc.large */
	double footprint; /* what of its share of the pixel a ray covers, 0..1 of a side */
};

/* Of a picture of clouds from below. Perspectives, which are for looking, have one ray a pixel. */
struct view_samples view_samples_of(const struct scene *scene);

/* Averages the rows of one view of `fine`, which has so many rays a side of a pixel, into `picture`. Weights are solid angles, so that
 * integrals stay what they are; of distances the mean is over rays that meet anything. The rays leave out the sun's disc: it is added here
 * to the layers that show it, when it is one of the kinds of light that are shown (`paths` of a scene). The block holds the view's camera
 * and disc. false (and log lines) when the program does not compile. */
bool view_samples_reduce(struct view_samples_stage *stage, const struct camera_view *view, int per_side, enum layer layer, uint32_t paths,
			 const struct texture *fine, struct texture *picture);

#endif
