/* How long the parts of a request took, and the Server-Timing header (W3C) that says so. One thread at a time. */
#ifndef STRATUS_SERVER_SERVER_TIMING_H
#define STRATUS_SERVER_SERVER_TIMING_H

#include "renderer/renderer.h"

enum timing {
	TIMING_QUEUE,
	TIMING_OPTICS,
	TIMING_SKY,
	TIMING_FIELD,
	TIMING_RADIOSITY,
	TIMING_VIEW,
	TIMING_READBACK,
	TIMING_COMPARE,
	TIMING_ENCODE,
	TIMING_CACHE,  /* taking a finished image from memory */
	TIMING_SHARED, /* waiting for the same image as another request */
	TIMING_TOTAL,
	TIMING_COUNT
};

/* As they stand in the header and in the metrics. */
extern const char *const timing_names[TIMING_COUNT];

/* Zero: nothing measured. */
struct timings {
	struct {
		bool measured, reused;
		double milliseconds;
	} entry[TIMING_COUNT];
	int radiosity_passes; /* of a radiosity that was not reused */
	double radiosity_residual;
};

enum { SERVER_TIMING_SIZE = 512 };

void timings_set(struct timings *timings, enum timing timing, double milliseconds);

/* Takes over the stages of a rendered frame. */
void timings_set_frame(struct timings *timings, const struct frame *frame);

/* Says of all that it takes to render that it was taken from memory, since the finished image was. */
void timings_set_reused(struct timings *timings);

/* Adds those of another one; what any of them had to make was not reused. */
void timings_add_frame(struct timings *timings, const struct timings *frame);

/* Adds what was spent on the optics before; `computed`: they did not come from memory. */
void timings_add_optics(struct timings *timings, double milliseconds, bool computed);

/* Adds what was spent before the renderer on what a stage begins with. */
void timings_add(struct timings *timings, enum timing timing, double milliseconds);

/* The header's value: what was measured, in the order above. */
void timings_format(const struct timings *timings, char text[static SERVER_TIMING_SIZE]);

#endif
