/* Pictures of other sizes. Smaller: means over the area of each new texel, so that the mean of the picture stays. Larger: cubic between the
 * centres of texels, which it meets, without ever leaving the range of its neighbours (Fritsch and Carlson 1980, "Monotone Piecewise Cubic
 * Interpolation"). Edges are periodic. Any thread.
 */
#ifndef STRATUS_RENDERER_RESAMPLE_H
#define STRATUS_RENDERER_RESAMPLE_H

#include <stdbool.h>

/* from: rows of width x channels. The caller frees; NULL when out of memory. */
float *resample_periodic(const float *from, int width, int height, int channels, int to_width, int to_height);

/* Means of a picture that comes row by row and need never be in memory as a whole. */
struct resample_reducer {
	int width, height, channels; /* of what comes */
	int to_width, to_height;     /* of what remains, neither more than comes */
	float *to;                   /* rows of to_width x channels, the caller's */
	float *row;                  /* one row of the new width */
	int rows;                    /* that came */
};

/* false when out of memory. `to` stays the caller's and is written. */
bool resample_reducer_init(struct resample_reducer *reducer, int width, int height, int channels, int to_width, int to_height, float *to);
void resample_reducer_finish(struct resample_reducer *reducer);

/* The next row, from the first on; after the last one `to` is complete. */
void resample_reducer_add(struct resample_reducer *reducer, const float *row);

#endif
