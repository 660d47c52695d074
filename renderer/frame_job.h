/* The stages of one picture, each a function of what the ones before it left in the job. The renderer's thread alone. */
#ifndef STRATUS_RENDERER_FRAME_JOB_H
#define STRATUS_RENDERER_FRAME_JOB_H

#include "renderer/renderer_parts.h"

/* What a reference keeps from one call to the next. */
struct render_pending {
	struct reference_work *work;
	struct stage_timing spent[STAGE_COUNT];
};

/* Work of one call of renderer_render. */
struct frame_job {
	struct renderer *renderer;
	const struct scene *scene;
	renderer_cancelled *cancelled, *paused;
	void *cancel_context;
	struct render_pending **pending;
	bool unfinished; /* the rest is for another call */
	struct frame *frame;

	struct ground_maps ground;
	const struct droplets *droplets;
	const struct texture *slab_rows, *slab_slices;
	struct sky_tables sky;
	struct field_maps maps;
	struct radiosity_light light;
	bool clouds;
	const struct texture *pictures[LAYER_COUNT];
};

/* Runs one stage; those before it have been. false: the stage could not do its work, or was stopped (job->unfinished: it goes on in another
 * call). */
bool frame_job_run(struct frame_job *job, enum stage stage);

#endif
