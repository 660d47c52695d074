/* Who is let in: whether a request's pictures fit into the memory that there may be for such, and whether they can be done in time.
 *
 * What a request was promised of the memory is its own until it ends. A daemon with nothing to do tries whatever it is asked for, and an
 * estimate that was not measured of late refuses nobody (cost_model.h): so no wrong estimate can last.
 */
#ifndef STRATUS_SERVER_ADMISSION_H
#define STRATUS_SERVER_ADMISSION_H

#include "server/request.h"

struct config;
struct render_job;
struct scene;
struct sky_directions;

/* Adds to the problem what a picture is too large for: --picture-mpixels, --memory-mb. Any thread. */
void admission_check_size(const struct config *config, const struct scene *scene, const char *pointer, struct problem *problem);

/* Whether a request may be worked for. scenes: its pictures, one after the other; directions: light in these instead, of one scene. On
 * false request->problem says why not; else it holds its memory until admission_leave. HTTP thread. */
bool admission_enter(struct request *request, const struct scene *const *scenes, int count, const struct sky_directions *directions,
		     double deadline_ms);

/* The request's answer is there, and takes so many bytes; or the request ends, with 0. Any thread that the request belongs to. */
void admission_keep(struct request *request, size_t bytes);

/* Says of a job, which has its deadline, whom it is for and what it will cost; before it is pushed. Any thread that the request belongs to.
 */
void admission_price(const struct request *request, struct render_job *job);

/* States why a queue did not take the job, or the thread that decodes. HTTP thread. */
void admission_refuse(struct request *request, const struct render_job *job);

/* Seconds after which the line will be as much shorter as the request that has this problem needs it to be, from 1. Any thread. */
unsigned admission_retry_seconds(const struct request *request);

#endif
