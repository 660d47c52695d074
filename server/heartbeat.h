/* Signs of life of a thread that works for others and may be held up by what it calls, such as a driver.
 *
 * The thread beats while it works, whenever something has come of it; any thread may look how long ago that was. Zero: idle.
 */
#ifndef STRATUS_SERVER_HEARTBEAT_H
#define STRATUS_SERVER_HEARTBEAT_H

#include "server/clock.h"

#include <stdbool.h>

struct heartbeat {
	_Atomic double last_ms;  /* 0: idle */
	_Atomic double limit_ms; /* between two beats of what it works at now */
};

/* Begins work that beats at least so often unless it hangs. */
static inline void heartbeat_begin(struct heartbeat *heartbeat, double limit_ms)
{
	heartbeat->limit_ms = limit_ms;
	heartbeat->last_ms = clock_now_ms();
}

static inline void heartbeat_beat(struct heartbeat *heartbeat)
{
	heartbeat->last_ms = clock_now_ms();
}

static inline void heartbeat_end(struct heartbeat *heartbeat)
{
	heartbeat->last_ms = 0;
}

/* Milliseconds since the last beat, 0 when idle. Any thread. */
static inline double heartbeat_silence_ms(const struct heartbeat *heartbeat)
{
	const double last_ms = heartbeat->last_ms;
	return last_ms > 0 ? clock_now_ms() - last_ms : 0;
}

/* Has it been silent for too long? Any thread. */
static inline bool heartbeat_is_overdue(const struct heartbeat *heartbeat)
{
	return heartbeat_silence_ms(heartbeat) > heartbeat->limit_ms;
}

#endif
