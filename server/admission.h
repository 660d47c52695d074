/* Who is let in: whether there is a place for a request (intake.h), whether its pictures fit into the memory that there may be for such,
 * and whether they can be done in time.
 *
 * What was promised belongs to the work, which may go on for others when its request has ended. A daemon with nothing to do tries whatever
 * it is asked for, and an estimate that was not measured of late refuses nobody (cost_model.h): so no wrong estimate can last.
 */
#ifndef STRATUS_SERVER_ADMISSION_H
#define STRATUS_SERVER_ADMISSION_H

#include "server/intake.h"
#include "server/request.h"

struct config;
struct render_job;
struct scene;
struct sky_directions;

/* Adds to the problem what a picture is too large for: --picture-mpixels, --memory-mb. Any thread. */
void admission_check_size(const struct config *config, const struct scene *scene, const char *pointer, struct problem *problem);

/* Of the work for a request. Zero: nothing. */
struct promise {
	struct intake_place place;
	size_t memory_bytes;
};

/* Whether a request may be worked for. scenes: its pictures, one after the other; directions: light in these instead, of one scene. On
 * false request->problem says why not; else the promise holds until admission_leave. HTTP thread. */
bool admission_enter(struct request *request, struct promise *promise, const struct scene *const *scenes, int count,
		     const struct sky_directions *directions, double deadline_ms);

/* Whether a request may wait for the picture that others have in work, by the number of their flight: it takes nothing, so that its
 * deadline alone counts. On false request->problem says why not. HTTP thread. */
bool admission_join(struct request *request, unsigned long flight, const struct scene *scene, double deadline_ms);

/* The work has ended, before its request hears of it, with what was asked for or without. Once or more; any thread. */
void admission_leave(struct service *service, struct promise *promise, bool answered);

/* The request has an answer of its own, which takes so many bytes until it is sent; with 0 it is. Any thread that the request belongs to.
 */
void admission_keep(struct request *request, size_t bytes);

/* Says of a job, which has its deadline, whom it is for and what it will cost; before it is pushed. Any thread that the request belongs to.
 */
void admission_price(const struct request *request, struct render_job *job);

/* States why a queue did not take the job, or the thread that decodes: half of the places at most are for those who wait there. HTTP
 * thread. */
void admission_refuse(struct request *request, const struct render_job *job);

/* Seconds after which the line will be as much shorter as the request that has this problem needs it to be, from 1. Any thread. */
unsigned admission_retry_seconds(const struct request *request);

#endif
