/* The golden render: a small fixed picture, rendered by the real stages on the real context and compared with what it should be.
 *
 * A device may take every call and draw nothing, or draw rubbish. The picture's means over blocks are compared, with a tolerance that
 * leaves room for the last bits of devices and for dither, and none for a stage that does not work.
 */
#ifndef STRATUS_RENDERER_GOLDEN_H
#define STRATUS_RENDERER_GOLDEN_H

#include "renderer/renderer.h"

#include <stdio.h>

enum { GOLDEN_COLUMNS = 12, GOLDEN_ROWS = 9, GOLDEN_BLOCK = 8 }; /* blocks, and pixels of their side */

/* Means of the blocks, rows from the top, red, green and blue: encoded values, 0..255. */
struct golden_picture {
	float mean[GOLDEN_ROWS][GOLDEN_COLUMNS][3];
};

/* What the built-in shaders make of it (renderer/golden_values.inc, by `make golden`). */
extern const struct golden_picture golden_expected;

enum golden_result { GOLDEN_PASSED, GOLDEN_FAILED, GOLDEN_CANCELLED };

/* Renders it anew and, where it comes out, gives what it is. with_sky: what is remembered of its sky does not count either, so that memory
 * must be had for a new one. As renderer_render. GOLDEN_FAILED: it does not come out, or is one colour. */
enum golden_result golden_render(struct renderer *renderer, bool with_sky, renderer_cancelled *cancelled, void *context,
				 struct golden_picture *picture);

/* Is it what is expected? else a log line says how far it is from that. */
bool golden_compare(const struct golden_picture *picture, const struct golden_picture *expected);

/* Writes it as renderer/golden_values.inc. */
void golden_print(const struct golden_picture *picture, FILE *file);

#endif
