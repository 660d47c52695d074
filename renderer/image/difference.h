/* How far a picture is from another that is taken for the truth, in scene light. Pure functions; any thread. */
#ifndef STRATUS_RENDERER_IMAGE_DIFFERENCE_H
#define STRATUS_RENDERER_IMAGE_DIFFERENCE_H

#include <stddef.h>
#include <stdint.h>

/* Two pictures of three channels, interleaved, and the standard errors of their values; NULL where they are exact. */
struct difference_pair {
	const float *picture, *truth;
	const float *picture_error, *truth_error;
};

/* Over the pixels and channels of a region. Relative figures are over the truth's mean there; NaN in a region without pixels or light.
 * Noise counts towards the RMS whatever its sign: rms^2 = (what the pictures differ by)^2 + noise^2, in the mean. */
struct difference {
	size_t pixels;
	double truth_mean;          /* in the picture's unit */
	double bias;                /* mean of picture - truth, relative */
	double bias_standard_error; /* of that, as far as noise goes; channels taken to err together, so at most so much. 0: no noise */
	double channel_bias[3];     /* of red, green, blue, each over the truth's own mean */
	double rms;                 /* root of the mean square of picture - truth, relative */
	double noise;               /* root of the mean square of both standard errors, relative */
	double noise_corrected_rms; /* root of rms^2 - noise^2; 0 where noise explains all of it */
	double noise_corrected_rms_standard_error; /* of that, at most: from its scatter over pixels. 0: no noise */
};

/* Measures the pixels whose mask has a bit of `bits`; count: of pixels. */
struct difference difference_measure(const struct difference_pair *pair, const uint8_t *mask, uint8_t bits, size_t count);

/* Mean and largest value of one plane over the same pixels; NaN when there are none. */
struct difference_span {
	double mean, largest;
};
struct difference_span difference_span(const float *plane, const uint8_t *mask, uint8_t bits, size_t count);

#endif
