/* Numbers as colours that look as far apart as the numbers are. 8 bit sRGB. Any thread. */
#ifndef STRATUS_RENDERER_IMAGE_FALSE_COLOUR_H
#define STRATUS_RENDERER_IMAGE_FALSE_COLOUR_H

/* 0 black, over violet and orange, to 1 pale yellow: "magma" of matplotlib (S. van der Walt, N. Smith, CC0). */
void false_colour_magma(float x, unsigned char rgb[3]);

/* -1 blue, 0 near white, 1 red: the "cool to warm" map of K. Moreland, "Diverging Color Maps for Scientific Visualization", 2009. */
void false_colour_diverging(float x, unsigned char rgb[3]);

#endif
