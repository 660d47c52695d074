/* Time that the GPU spends between two points of the command stream. Owner thread of the context. */
#ifndef STRATUS_RENDERER_GL_TIMER_H
#define STRATUS_RENDERER_GL_TIMER_H

struct gl_timer {
	unsigned queries[2]; /* time stamps; 0 before the first use */
};

/* Marks the beginning; queries are made on first use. */
void gl_timer_begin(struct gl_timer *timer);
void gl_timer_end(struct gl_timer *timer);

/* Milliseconds between both; waits for the GPU. */
double gl_timer_milliseconds(const struct gl_timer *timer);

/* Takes a zeroed timer. */
void gl_timer_finish(struct gl_timer *timer);

/* Milliseconds of the processor's monotonic clock. Any thread. */
double clock_milliseconds(void);

#endif
