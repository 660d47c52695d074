#include "renderer/image/flip.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Numbers in this file without another source are the paper's: sections 4.1 (colour), 4.2 (features) and 4.3 (both). */

enum { WIDTH_MAX = 8192, RADIUS_MAX = 160, TAPS_MAX = 2 * RADIUS_MAX + 1 };

/* One dimension of a filter that is a product of two. */
struct kernel_1d {
	int radius;
	float tap[TAPS_MAX];
};

/* --- colours -------------------------------------------------------------------------------------------------------------------------- */

/* Linear Rec. 709 to XYZ over the white of D65, whose own XYZ are the sums of its rows. */
static const double rec709_xyz[3][3] = {{10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794},
					{2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
					{1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382}};

/* XYZ over those of white. */
static void xyz_of(const float rgb[3], float xyz[3])
{
	for (int i = 0; i < 3; i++) {
		const double *row = rec709_xyz[i];
		xyz[i] =
			(float)((row[0] * (double)rgb[0] + row[1] * (double)rgb[1] + row[2] * (double)rgb[2]) / (row[0] + row[1] + row[2]));
	}
}

static void opponents_of(const float xyz[3], float ycc[3])
{
	ycc[0] = 116 * xyz[1] - 16;
	ycc[1] = 500 * (xyz[0] - xyz[1]);
	ycc[2] = 200 * (xyz[1] - xyz[2]);
}

/* Back to linear Rec. 709, within its gamut. */
static void rgb_of_opponents(const float ycc[3], float rgb[3])
{
	/* The inverse of rec709_xyz. */
	static const float back[3][3] = {{3.241003275f, -1.537398934f, -0.498615861f},
					 {-0.969224334f, 1.875930071f, 0.041554224f},
					 {0.055639423f, -0.204011202f, 1.057148933f}};
	static const float white[3] = {0.950428545f, 1.0f, 1.088900371f};
	const float y = (ycc[0] + 16) / 116;
	const float xyz[3] = {white[0] * (y + ycc[1] / 500), white[1] * y, white[2] * (y - ycc[2] / 200)};
	for (int i = 0; i < 3; i++)
		rgb[i] = fminf(fmaxf(back[i][0] * xyz[0] + back[i][1] * xyz[1] + back[i][2] * xyz[2], 0), 1);
}

static float lab_root(float x)
{
	const float delta = 6.0f / 29;
	return x > delta * delta * delta ? cbrtf(x) : x / (3 * delta * delta) + 4.0f / 29;
}

/* CIELAB, whose chroma grows with lightness (Hunt's effect). */
static void lab_of(const float rgb[3], float lab[3])
{
	float xyz[3];
	xyz_of(rgb, xyz);
	const float x = lab_root(xyz[0]), y = lab_root(xyz[1]), z = lab_root(xyz[2]), lightness = 116 * y - 16;
	lab[0] = lightness;
	lab[1] = 0.01f * lightness * 500 * (x - y);
	lab[2] = 0.01f * lightness * 200 * (y - z);
}

/* Distance of Abasi et al. 2020 for large differences: city block in lightness, Euclidean in chroma. */
static float hyab(const float a[3], const float b[3])
{
	return fabsf(a[0] - b[0]) + hypotf(a[1] - b[1], a[2] - b[2]);
}

/* --- giving up ------------------------------------------------------------------------------------------------------------------------ */

/* Rows and pixels between two questions: some milliseconds. */
enum { ASK_ROWS = 64, ASK_PIXELS = 1 << 17 };

struct patience {
	renderer_cancelled *cancelled;
	void *context;
	bool over;
};

static bool is_over(struct patience *patience)
{
	patience->over = patience->over || patience->cancelled(patience->context);
	return patience->over;
}

/* --- filters -------------------------------------------------------------------------------------------------------------------------- */

static int clamped_radius(double radius)
{
	return radius < RADIUS_MAX ? (int)ceil(radius) : RADIUS_MAX;
}

/* exp(-falloff x^2) at whole numbers, with sum 1; *sum: before. */
static void gauss_kernel(double falloff, int radius, struct kernel_1d *kernel, double *sum)
{
	*sum = 0;
	kernel->radius = radius;
	for (int i = -radius; i <= radius; i++)
		*sum += exp(-falloff * i * i);
	for (int i = -radius; i <= radius; i++)
		kernel->tap[i + radius] = (float)(exp(-falloff * i * i) / *sum);
}

/* First (edges) or second (points) derivative of a Gaussian along its axis, its positive taps with sum 1 and its negative ones with -1. */
static void derivative_kernel(double deviation, int radius, bool second, struct kernel_1d *kernel)
{
	double value[TAPS_MAX], positive = 0, negative = 0;
	kernel->radius = radius;
	for (int i = -radius; i <= radius; i++) {
		const double v = (second ? i * i / (deviation * deviation) - 1 : -i) * exp(-0.5 * i * i / (deviation * deviation));
		*(v > 0 ? &positive : &negative) += fabs(v);
		value[i + radius] = v;
	}
	for (int i = 0; i <= 2 * radius; i++)
		kernel->tap[i] = (float)(value[i] / (value[i] > 0 ? positive : negative));
}

static int clamp_index(int i, int count)
{
	return i < 0 ? 0 : i >= count ? count - 1 : i;
}

/* Along a row; what lies outside repeats the edge. `padded` has room for the row and a radius on both sides. */
static void filter_row(const float *from, float *to, int width, const struct kernel_1d *kernel, float *padded)
{
	const int radius = kernel->radius;
	for (int i = 0; i < width + 2 * radius; i++)
		padded[i] = from[clamp_index(i - radius, width)];
	memset(to, 0, (size_t)width * sizeof *to);
	for (int k = 0; k <= 2 * radius; k++)
		for (int x = 0; x < width; x++)
			to[x] += kernel->tap[k] * padded[x + k];
}

/* Columns are filtered a row at a time, so that memory is read along its grain. */
static void filter_columns(const float *from, float *to, int width, int height, const struct kernel_1d *kernel, struct patience *patience)
{
	for (int y = 0; y < height && (y % ASK_ROWS || !is_over(patience)); y++) {
		float *row = to + (size_t)y * (size_t)width;
		memset(row, 0, (size_t)width * sizeof *row);
		for (int k = -kernel->radius; k <= kernel->radius; k++) {
			const float tap = kernel->tap[k + kernel->radius];
			const float *other = from + (size_t)clamp_index(y + k, height) * (size_t)width;
			for (int x = 0; x < width; x++)
				row[x] += tap * other[x];
		}
	}
}

/* `spare` is a plane for what is between. */
static void filter_plane(const float *from, float *to, float *spare, int width, int height, const struct kernel_1d *across,
			 const struct kernel_1d *down, struct patience *patience)
{
	float padded[WIDTH_MAX + 2 * RADIUS_MAX];
	for (int y = 0; y < height && (y % ASK_ROWS || !is_over(patience)); y++)
		filter_row(from + (size_t)y * (size_t)width, spare + (size_t)y * (size_t)width, width, across, padded);
	filter_columns(spare, to, width, height, down, patience);
}

/* --- one picture ---------------------------------------------------------------------------------------------------------------------- */

/* A contrast sensitivity function: a1 exp(-pi^2 x^2 / b1) sqrt(pi / b1) + the same of a2, b2 (table 1). */
struct sensitivity {
	double a[2], b[2];
};
static const struct sensitivity sensitivities[3] = {{{1, 0}, {0.0047, 1e-5}}, {{1, 0}, {0.0053, 1e-5}}, {{34.1, 13.5}, {0.04, 0.025}}};

/* Planes of `work`: what is filtered, two of its filters' results, and one between. */
static void filter_seen(float *plane, float *work, int width, int height, const struct sensitivity *sensitivity, double per_degree,
			struct patience *patience)
{
	const size_t count = (size_t)width * (size_t)height;
	/* The widest Gaussian, b = 0.04, reaches three deviations. */
	const int radius = clamped_radius(3 * sqrt(0.04 / (2 * M_PI * M_PI)) * per_degree);
	float *results[2] = {work, work + count};
	double weight[2];
	for (int i = 0; i < 2; i++) {
		struct kernel_1d kernel;
		double sum;
		const double b = sensitivity->b[i];
		gauss_kernel(M_PI * M_PI / (b * per_degree * per_degree), radius, &kernel, &sum);
		weight[i] = sensitivity->a[i] * sqrt(M_PI / b) * sum * sum;
		if (weight[i] > 0)
			filter_plane(plane, results[i], work + 2 * count, width, height, &kernel, &kernel, patience);
	}
	const float share = (float)(weight[0] / (weight[0] + weight[1]));
	for (size_t i = 0; i < count && !patience->over; i++)
		plane[i] = share >= 1 ? results[0][i] : share * results[0][i] + (1 - share) * results[1][i];
}

/* Strength of edges, or points, of a plane of luminance. */
static void find_features(const float *luminance, float *strength, float *work, int width, int height, bool points, double per_degree,
			  struct patience *patience)
{
	const size_t count = (size_t)width * (size_t)height;
	const double deviation = 0.5 * 0.082 * per_degree; /* half the width of the human detector of edges, in degrees */
	const int radius = clamped_radius(3 * deviation);
	struct kernel_1d derivative, smooth;
	double sum;
	derivative_kernel(deviation, radius, points, &derivative);
	gauss_kernel(0.5 / (deviation * deviation), radius, &smooth, &sum);
	filter_plane(luminance, work, work + 2 * count, width, height, &derivative, &smooth, patience);
	filter_plane(luminance, work + count, work + 2 * count, width, height, &smooth, &derivative, patience);
	for (size_t i = 0; i < count && !patience->over; i++)
		strength[i] = hypotf(work[i], work[count + i]);
}

/* 8 bit codes to linear light, IEC 61966-2-1. */
static void fill_linear(float linear[256])
{
	for (int i = 0; i < 256; i++) {
		const double x = i / 255.0;
		linear[i] = (float)(x > 0.04045 ? pow((x + 0.055) / 1.055, 2.4) : x / 12.92);
	}
}

static void split_opponents(const unsigned char *codes, float *planes, size_t count, struct patience *patience)
{
	float linear[256];
	fill_linear(linear);
	for (size_t i = 0; i < count && (i % ASK_PIXELS || !is_over(patience)); i++) {
		const float rgb[3] = {linear[codes[3 * i]], linear[codes[3 * i + 1]], linear[codes[3 * i + 2]]};
		float xyz[3], ycc[3];
		xyz_of(rgb, xyz);
		opponents_of(xyz, ycc);
		for (size_t c = 0; c < 3; c++)
			planes[c * count + i] = ycc[c];
	}
}

static void opponents_to_lab(float *planes, size_t count, struct patience *patience)
{
	for (size_t i = 0; i < count && (i % ASK_PIXELS || !is_over(patience)); i++) {
		const float ycc[3] = {planes[i], planes[count + i], planes[2 * count + i]};
		float rgb[3], lab[3];
		rgb_of_opponents(ycc, rgb);
		lab_of(rgb, lab);
		for (size_t c = 0; c < 3; c++)
			planes[c * count + i] = lab[c];
	}
}

bool flip_picture_init(struct flip_picture *picture, const unsigned char *codes, int width, int height, double pixels_per_degree,
		       renderer_cancelled *cancelled, void *context)
{
	const size_t count = (size_t)width * (size_t)height;
	struct patience patience = {cancelled, context, false};
	*picture = (struct flip_picture){width, height, malloc(3 * count * sizeof(float)), malloc(2 * count * sizeof(float))};
	float *work = malloc(4 * count * sizeof *work);
	const bool ok = picture->lab && picture->features && work;
	if (ok) {
		float *luminance = work + 3 * count;
		split_opponents(codes, picture->lab, count, &patience);
		for (size_t i = 0; i < count && !patience.over; i++)
			luminance[i] = (picture->lab[i] + 16) / 116;
		for (int points = 0; points < 2 && !patience.over; points++)
			find_features(luminance, picture->features + (size_t)points * count, work, width, height, points, pixels_per_degree,
				      &patience);
		for (size_t c = 0; c < 3 && !patience.over; c++)
			filter_seen(picture->lab + c * count, work, width, height, &sensitivities[c], pixels_per_degree, &patience);
		if (!patience.over)
			opponents_to_lab(picture->lab, count, &patience);
	}
	free(work);
	return ok && !patience.over;
}

void flip_picture_finish(struct flip_picture *picture)
{
	free(picture->lab);
	free(picture->features);
	*picture = (struct flip_picture){0};
}

/* --- two pictures --------------------------------------------------------------------------------------------------------------------- */

/* The largest difference that colours can have, that of green and blue, to the power that differences are taken to. */
static float largest_colour_difference(void)
{
	float green[3], blue[3];
	lab_of((const float[3]){0, 1, 0}, green);
	lab_of((const float[3]){0, 0, 1}, blue);
	return powf(hyab(green, blue), 0.7f);
}

/* Differences up to 0.4 of the largest fill 0 to 0.95. */
static float colour_difference(float distance, float largest)
{
	const float d = powf(distance, 0.7f), knee = 0.4f * largest;
	return d < knee ? 0.95f / knee * d : 0.95f + (d - knee) / (largest - knee) * 0.05f;
}

void flip_compare(const struct flip_picture *truth, const struct flip_picture *picture, size_t first, size_t end, float *map)
{
	const size_t count = (size_t)truth->width * (size_t)truth->height;
	const float largest = largest_colour_difference();
	for (size_t i = first; i < end; i++) {
		float a[3], b[3];
		for (size_t c = 0; c < 3; c++)
			a[c] = truth->lab[c * count + i], b[c] = picture->lab[c * count + i];
		const float edges = fabsf(truth->features[i] - picture->features[i]);
		const float points = fabsf(truth->features[count + i] - picture->features[count + i]);
		const float features = sqrtf(fmaxf(edges, points) * (float)M_SQRT1_2);
		map[i] = powf(colour_difference(hyab(a, b), largest), 1 - fminf(features, 1));
	}
}
