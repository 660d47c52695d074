#include "server/transfers.h"

#include "server/clock.h"

#include <math.h>
#include <string.h>

void transfers_add(struct transfers *transfers, struct render_job *job, double began_ms)
{
	transfers->entries[transfers->count].job = job;
	transfers->entries[transfers->count].began_ms = began_ms;
	transfers->count++;
}

struct render_job *transfers_take(struct transfers *transfers, struct renderer *renderer, double milliseconds, enum render_result *result,
				  double *took_ms)
{
	if (transfers->count == 0)
		return NULL;
	struct render_job *job = transfers->entries[0].job;
	*result = renderer_arrive(renderer, &job->frame, milliseconds);
	if (*result == RENDER_UNFINISHED)
		return NULL;
	const double now_ms = clock_now_ms();
	*took_ms = now_ms - fmax(transfers->entries[0].began_ms, transfers->last_ms);
	transfers->last_ms = now_ms;
	transfers->count--;
	memmove(transfers->entries, transfers->entries + 1, (size_t)transfers->count * sizeof *transfers->entries);
	return job;
}
