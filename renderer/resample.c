#include "renderer/resample.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Values along a row or a column: the i-th of a channel stands at i * step. */
struct line {
	float *values;
	int count;
	size_t step;
};

/* --- smaller ---------------------------------------------------------------------------------------------------------------------- */

/* Mean over [from, to), in texels, which lies within the line. */
static float mean_over(const struct line *line, double from, double to)
{
	const int first = (int)from, last = (int)fmin(ceil(to), line->count) - 1;
	double sum = 0;
	for (int i = first; i <= last; i++)
		sum += (fmin(i + 1, to) - fmax(i, from)) * line->values[(size_t)i * line->step];
	return (float)(sum / (to - from));
}

static void reduce_line(const struct line *from, const struct line *to)
{
	const double scale = (double)from->count / to->count;
	for (int i = 0; from->count == to->count && i < to->count; i++)
		to->values[(size_t)i * to->step] = from->values[(size_t)i * from->step];
	for (int i = 0; from->count > to->count && i < to->count; i++)
		to->values[(size_t)i * to->step] = mean_over(from, i * scale, fmin((i + 1) * scale, from->count));
}

bool resample_reducer_init(struct resample_reducer *reducer, int width, int height, int channels, int to_width, int to_height, float *to)
{
	*reducer = (struct resample_reducer){
		.width = width, .height = height, .channels = channels, .to_width = to_width, .to_height = to_height, .to = to};
	memset(to, 0, (size_t)to_width * (size_t)to_height * (size_t)channels * sizeof *to);
	reducer->row = malloc((size_t)to_width * (size_t)channels * sizeof *reducer->row);
	return reducer->row != NULL;
}

void resample_reducer_finish(struct resample_reducer *reducer)
{
	free(reducer->row);
	reducer->row = NULL;
}

void resample_reducer_add(struct resample_reducer *reducer, const float *row)
{
	const size_t channels = (size_t)reducer->channels, count = (size_t)reducer->to_width * channels;
	for (size_t c = 0; c < channels; c++)
		reduce_line(&(struct line){(float *)row + c, reducer->width, channels},
			    &(struct line){reducer->row + c, reducer->to_width, channels});
	/* The new rows that this one lies in: one, or two where it lies across their edge. */
	const double scale = (double)reducer->to_height / reducer->height, top = reducer->rows * scale, bottom = top + scale;
	for (int y = (int)top; y < reducer->to_height && y < bottom; y++) {
		const float weight = (float)(fmin(y + 1, bottom) - fmax(y, top));
		float *to = reducer->to + (size_t)y * count;
		for (size_t i = 0; i < count && weight > 0; i++)
			to[i] += weight * reducer->row[i];
	}
	reducer->rows++;
}

/* --- larger ----------------------------------------------------------------------------------------------------------------------- */

/* Slopes at all texels out of the differences to both sides: none at an extreme, else their harmonic mean, which keeps the curve monotone
 * (Fritsch and Butland 1984). */
static void find_slopes(const struct line *line, float *slopes)
{
	const int n = line->count;
	for (int i = 0; i < n; i++) {
		const float here = line->values[(size_t)i * line->step];
		const float before = here - line->values[(size_t)(i > 0 ? i - 1 : n - 1) * line->step];
		const float after = line->values[(size_t)(i + 1 < n ? i + 1 : 0) * line->step] - here;
		slopes[i] = before * after <= 0 ? 0 : 2 * before * after / (before + after);
	}
}

static void enlarge_line(const struct line *from, const struct line *to, float *slopes)
{
	const double scale = (double)from->count / to->count;
	find_slopes(from, slopes);
	for (int i = 0; i < to->count; i++) {
		const double at = (i + 0.5) * scale - 0.5;
		const int base = (int)floor(at), left = base < 0 ? from->count - 1 : base, right = left + 1 < from->count ? left + 1 : 0;
		const float t = (float)(at - base), u = 1 - t;
		const float a = from->values[(size_t)left * from->step], b = from->values[(size_t)right * from->step];
		const float curve = a + t * t * (3 - 2 * t) * (b - a) + t * u * (u * slopes[left] - t * slopes[right]);
		to->values[(size_t)i * to->step] = fminf(fmaxf(curve, fminf(a, b)), fmaxf(a, b)); /* rounding apart, it is within */
	}
}

static void resample_line(const struct line *from, const struct line *to, float *slopes)
{
	if (to->count <= from->count)
		reduce_line(from, to);
	else
		enlarge_line(from, to, slopes);
}

float *resample_periodic(const float *from, int width, int height, int channels, int to_width, int to_height)
{
	const size_t c = (size_t)channels, row = (size_t)width * c, to_row = (size_t)to_width * c;
	float *to = malloc((size_t)to_height * to_row * sizeof *to);
	if (to && width == to_width && height == to_height)
		return memcpy(to, from, (size_t)height * row * sizeof *to);
	float *wide = malloc((size_t)height * to_row * sizeof *wide);
	float *slopes = malloc((size_t)(width > height ? width : height) * sizeof *slopes);
	if (!wide || !to || !slopes) {
		free(to);
		to = NULL;
		goto end;
	}
	for (size_t y = 0; y < (size_t)height; y++)
		for (size_t k = 0; k < c; k++)
			resample_line(&(struct line){(float *)from + y * row + k, width, c},
				      &(struct line){wide + y * to_row + k, to_width, c}, slopes);
	for (size_t x = 0; x < to_row; x++)
		resample_line(&(struct line){wide + x, height, to_row}, &(struct line){to + x, to_height, to_row}, slopes);

end:
	free(slopes);
	free(wide);
	return to;
}
