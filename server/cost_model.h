/* What a picture will cost, from what others did cost: milliseconds of the render thread and of an encoder. Any thread.
 *
 * Measured per kind of picture (model, clear or clouded, from below or above, PNG or EXR) as a fixed part and one for each megapixel, both
 * fitted with weights that fade by a tenth with every measurement. What frames share (optics of a sun, sky, field by type of
 * cloud, radiosity, droplets) counts apart, and for nothing where a picture had the same of late; how long ago that may be follows from
 * what stages say that they reused. Lives in memory only.
 *
 * A single odd measurement moves an estimate by no more than a tenth of fourfold, and estimates grow old: what was not measured for
 * COST_FRESH_MS is still good for an order but no reason to refuse anything (cost.fresh).
 */
#ifndef STRATUS_SERVER_COST_MODEL_H
#define STRATUS_SERVER_COST_MODEL_H

#include "server/render_queue.h"

#define COST_FRESH_MS 30000.0

struct cost {
	double prepare_ms; /* of the thread that prepares droplets; 0 where they are known */
	double render_ms;  /* of the render thread */
	double encode_ms;  /* of an encoder */
	bool fresh;        /* measured lately, so good enough to refuse by */
};

struct cost_model;

/* NULL (and a log line) when out of memory. */
struct cost_model *cost_model_create(void);
void cost_model_destroy(struct cost_model *model);

/* Where to start, before anything is measured: on a processor, or on a GPU. */
void cost_model_start(struct cost_model *model, bool software);

/* What a picture, or the light in so many directions (NULL: a picture), would cost. needs_droplets: its droplets are not known. */
struct cost cost_model_predict(struct cost_model *model, const struct scene *scene, const struct sky_directions *directions,
			       bool needs_droplets);

/* How much slower than predicted renders were of late, 0.25..4: load from elsewhere shows here first. For what is to come, not for what
 * a client pays. */
double cost_model_pace(struct cost_model *model);

/* A picture of this scene is on its way: what it shares counts as known from now on. ranks: for the job, how long ago each part was asked
 * for. */
void cost_model_expect(struct cost_model *model, const struct scene *scene, int ranks[static COST_PARTS]);

/* A job was rendered: job->spent_ms, prepared_ms and the stages of its frame say what it cost. */
void cost_model_learn(struct cost_model *model, const struct render_job *job);
/* Its picture was encoded. */
void cost_model_learn_encoding(struct cost_model *model, const struct scene *scene, double milliseconds);

#endif
