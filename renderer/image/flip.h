/* FLIP: how much an observer who alternates between two pictures on a screen notices of their difference, from 0 to 1 for each pixel.
 *
 * P. Andersson, J. Nilsson, T. Akenine-Moller, M. Oskarsson, K. Astrom, M. D. Fairchild, "FLIP: A Difference Evaluator for Alternating
 * Images", Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020; for pictures of low dynamic range (LDR-FLIP). Any thread.
 */
#ifndef STRATUS_RENDERER_IMAGE_FLIP_H
#define STRATUS_RENDERER_IMAGE_FLIP_H

#include "renderer/renderer.h"

#include <stdbool.h>
#include <stddef.h>

/* Of an observer 0.7 m in front of a screen 0.7 m and 3840 pixels wide, as in the paper: 3840 pi / 180. */
#define FLIP_PIXELS_PER_DEGREE 67.02064327658225

/* What FLIP needs of one picture, so that a truth is looked at once for several. Zero is none. */
struct flip_picture {
	int width, height;
	float *lab;      /* three planes: colour as far as it is seen at the distance, CIELAB with Hunt's effect */
	float *features; /* two planes: strength of edges and of points */
};

/* codes: 8 bit sRGB, three channels interleaved, rows from the top, at most 8192 wide; pixels_per_degree from 1 to 1000. cancelled is
 * asked every few rows. false when out of memory or cancelled. flip_picture_finish in any case. */
bool flip_picture_init(struct flip_picture *picture, const unsigned char *codes, int width, int height, double pixels_per_degree,
		       renderer_cancelled *cancelled, void *context);
void flip_picture_finish(struct flip_picture *picture);

/* The map of the pixels from `first` up to `end`, of two pictures of one size; symmetric in them. `map` is the whole one. */
void flip_compare(const struct flip_picture *truth, const struct flip_picture *picture, size_t first, size_t end, float *map);

#endif
