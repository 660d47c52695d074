/* Jobs whose pictures are rendered and on their way to memory, in the order in which they will arrive. The render thread's own. */
#ifndef STRATUS_SERVER_TRANSFERS_H
#define STRATUS_SERVER_TRANSFERS_H

#include "server/render_queue.h"

/* Zero: none. */
struct transfers {
	struct {
		struct render_job *job;
		double began_ms; /* when its rendering did, on the clock of clock.h */
	} entries[RENDERER_TRANSFERS_MAX];
	int count;
	double last_ms; /* when the last one before these arrived */
};

/* Takes a job whose frame is on its way. */
void transfers_add(struct transfers *transfers, struct render_job *job, double began_ms);

/* The next job that has arrived, waiting no longer than so many milliseconds; NULL when none has. result: RENDER_OK or RENDER_FAILED;
 * took_ms: what the renderer spent on it, that is, since it began or since the one before arrived. */
struct render_job *transfers_take(struct transfers *transfers, struct renderer *renderer, double milliseconds, enum render_result *result,
				  double *took_ms);

#endif
