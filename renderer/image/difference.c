#include "renderer/image/difference.h"

#include <math.h>

enum { CHANNELS = 3 };

struct sums {
	size_t pixels;
	double truth[CHANNELS], difference[CHANNELS];
	double square;                /* of differences, all channels */
	double variance[CHANNELS];    /* of both pictures */
	double excess, excess_square; /* over pixels: squared difference beyond the variance, its square */
};

static double variance_at(const float *error, size_t i)
{
	return error ? (double)error[i] * (double)error[i] : 0;
}

static void add_pixel(const struct difference_pair *pair, size_t pixel, struct sums *sums)
{
	double excess = 0;
	sums->pixels++;
	for (int c = 0; c < CHANNELS; c++) {
		const size_t i = pixel * CHANNELS + (size_t)c;
		const double difference = (double)pair->picture[i] - (double)pair->truth[i];
		sums->truth[c] += (double)pair->truth[i];
		sums->difference[c] += difference;
		const double variance = variance_at(pair->picture_error, i) + variance_at(pair->truth_error, i);
		sums->square += difference * difference;
		sums->variance[c] += variance;
		excess += difference * difference - variance;
	}
	sums->excess += excess;
	sums->excess_square += excess * excess;
}

static double total(const double values[CHANNELS])
{
	return values[0] + values[1] + values[2];
}

/* Of the noise-corrected RMS, in the picture's unit: that of the mean excess, carried through the root. */
static double corrected_error(const struct sums *sums, double corrected)
{
	const double n = (double)sums->pixels, mean = sums->excess / n;
	const double error = sqrt(fmax(sums->excess_square / n - mean * mean, 0) / n) / CHANNELS;
	return total(sums->variance) == 0 ? 0 : corrected * corrected > error ? 0.5 * error / corrected : sqrt(error);
}

struct difference difference_measure(const struct difference_pair *pair, const uint8_t *mask, uint8_t bits, size_t count)
{
	struct sums sums = {0};
	for (size_t i = 0; i < count; i++)
		if (mask[i] & bits)
			add_pixel(pair, i, &sums);
	/* Of nothing: 0/0, NaN. */
	const double values = (double)sums.pixels * CHANNELS, truth = total(sums.truth) / values;
	const double unit = truth > 0 ? truth : NAN;
	struct difference result = {.pixels = sums.pixels, .truth_mean = truth};
	result.bias = total(sums.difference) / values / unit;
	result.bias_standard_error = (sqrt(sums.variance[0]) + sqrt(sums.variance[1]) + sqrt(sums.variance[2])) / values / unit;
	for (int c = 0; c < CHANNELS; c++)
		result.channel_bias[c] = sums.truth[c] > 0 ? sums.difference[c] / sums.truth[c] : NAN;
	result.rms = sqrt(sums.square / values) / unit;
	result.noise = sqrt(total(sums.variance) / values) / unit;
	const double corrected = sqrt(fmax(sums.square - total(sums.variance), 0) / values);
	result.noise_corrected_rms = corrected / unit;
	result.noise_corrected_rms_standard_error = corrected_error(&sums, corrected) / unit;
	return result;
}

struct difference_span difference_span(const float *plane, const uint8_t *mask, uint8_t bits, size_t count)
{
	size_t pixels = 0;
	double sum = 0, largest = 0;
	for (size_t i = 0; i < count; i++) {
		if (!(mask[i] & bits))
			continue;
		pixels++;
		sum += (double)plane[i];
		largest = fmax(largest, (double)plane[i]);
	}
	return (struct difference_span){pixels ? sum / (double)pixels : NAN, pixels ? largest : NAN};
}
