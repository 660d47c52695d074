/* The table of one mu_l for a renderer: the solution's pairs of nodes contracted with the sun's direction, then with the views', then
 * summed over azimuth. */
#include "renderer/optics/slab.h"

#include "renderer/optics/slab_evaluate.h"

#include <math.h>
#include <string.h>

enum { N = SLAB_NODE_COUNT, VIEWS = SLAB_SLICE_VIEW_COUNT, AZIMUTHS = SLAB_SLICE_AZIMUTH_COUNT, MODES = SLAB_MODE_COUNT };

/* Factors that all depths share. */
struct directions {
	float sun[N];
	float view[3][N][VIEWS]; /* of mode 0, of odd modes: times both sines, of even ones: times their squares */
	float cosine[MODES][AZIMUTHS];
};

double slab_slice_zenith(double view)
{
	return M_PI / 2 * sin(M_PI / 2 * view / (VIEWS - 1));
}

double slab_slice_view(double mu_v)
{
	return (VIEWS - 1) * (2 / M_PI) * asin(fmin(acos(mu_v) * (2 / M_PI), 1));
}

double slab_slice_azimuth(double index)
{
	double t = index / (AZIMUTHS - 1);
	return M_PI / 2 * (t + t * t);
}

double slab_slice_azimuth_index(double cosine)
{
	return (AZIMUTHS - 1) * (sqrt(0.25 + acos(cosine) * (2 / M_PI)) - 0.5);
}

static void fill_directions(const struct slab_solution *solution, double mu_l, struct directions *directions)
{
	double factor[N];
	slab_node_factors(solution, mu_l, factor);
	for (int i = 0; i < N; i++)
		directions->sun[i] = (float)factor[i];
	for (int view = 0; view < VIEWS; view++) {
		double zenith = slab_slice_zenith(view), sines = sin(zenith) * sqrt(1 - mu_l * mu_l);
		slab_node_factors(solution, cos(zenith), factor);
		for (int i = 0; i < N; i++) {
			directions->view[0][i][view] = (float)factor[i];
			directions->view[1][i][view] = (float)(sines * factor[i]);
			directions->view[2][i][view] = (float)(sines * sines * factor[i]);
		}
	}
	for (int mode = 0; mode < MODES; mode++)
		for (int i = 0; i < AZIMUTHS; i++)
			directions->cosine[mode][i] = (float)cos(mode * slab_slice_azimuth(i));
}

/* The loops below are written so that each innermost one is a sum of vectors; the same text is compiled for the processor's widest. */
#define INLINE static inline __attribute__((always_inline))

/* The sun's direction contracted; false when the mode does not matter beside the first. */
INLINE bool light_mode(const float *pair, const float sun[N], float lit[N], float *first)
{
	float largest = 0;
	for (int i = 0; i < N; i++)
		lit[i] = 0;
	for (int i = 0; i < N; i++) {
		float product[N], sum = 0;
		for (int j = 0; j <= i; j++)
			product[j] = sun[j] * pair[j];
		for (int j = 0; j < i; j++)
			lit[j] += sun[i] * pair[j];
		for (int j = 0; j <= i; j++)
			sum += product[j];
		lit[i] += sum;
		pair += i + 1;
	}
	for (int i = 0; i < N; i++)
		largest = largest > fabsf(lit[i]) ? largest : fabsf(lit[i]);
	if (*first == 0)
		*first = largest;
	return largest > 1e-5f * *first;
}

/* K of one depth, over views and azimuths. */
INLINE void fill_depth_any(const float order2[MODES][SLAB_PAIR_COUNT], const struct directions *directions, float k[VIEWS][AZIMUTHS])
{
	float first = 0;
	for (int view = 0; view < VIEWS; view++)
		for (int i = 0; i < AZIMUTHS; i++)
			k[view][i] = 0;
	for (int mode = 0; mode < MODES; mode++) {
		float lit[N], value[VIEWS] = {0};
		if (!light_mode(order2[mode], directions->sun, lit, &first))
			continue;
		for (int i = 0; i < N; i++)
			for (int view = 0; view < VIEWS; view++)
				value[view] += directions->view[mode == 0 ? 0 : 2 - mode % 2][i][view] * lit[i];
		for (int view = 0; view < VIEWS; view++)
			for (int i = 0; i < AZIMUTHS; i++)
				k[view][i] += value[view] * directions->cosine[mode][i];
	}
}

typedef void fill_function(const float order2[MODES][SLAB_PAIR_COUNT], const struct directions *directions, float k[VIEWS][AZIMUTHS]);

static void fill_128(const float order2[MODES][SLAB_PAIR_COUNT], const struct directions *directions, float k[VIEWS][AZIMUTHS])
{
	fill_depth_any(order2, directions, k);
}

#ifdef __x86_64__
__attribute__((target("avx2,fma"))) static void fill_256(const float order2[MODES][SLAB_PAIR_COUNT], const struct directions *directions,
							 float k[VIEWS][AZIMUTHS])
{
	fill_depth_any(order2, directions, k);
}
#endif

static fill_function *widest_fill(void)
{
#ifdef __x86_64__
	if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
		return fill_256;
#endif
	return fill_128;
}

static void fill_depth(const float order2[MODES][SLAB_PAIR_COUNT], const struct directions *directions, float k[VIEWS][AZIMUTHS])
{
	widest_fill()(order2, directions, k);
}

/* Depth `index` of a band, between those of the solution, into the slice. */
static void store_depth(const float (*depths)[VIEWS][AZIMUTHS], int index, double shift, int band, struct slab_slice *slice)
{
	struct stencil stencil = stencil_at(index + shift, SLAB_DEPTH_COUNT);
	const float *from = &depths[stencil.first][0][0], factor[STENCIL] = {(float)stencil.factor[0], (float)stencil.factor[1],
									     (float)stencil.factor[2], (float)stencil.factor[3]};
	float *to = &slice->k[index][0][0][band];
	for (int i = 0; i < VIEWS * AZIMUTHS; i++) {
		float sum = 0;
		for (int k = 0; k < STENCIL; k++)
			sum += factor[k] * from[k * VIEWS * AZIMUTHS + i];
		to[i * BAND_COUNT] = sum > 0 ? sum : 0;
	}
}

/* An infinitely deep layer reflects what the last one transmits, in the same directions, and transmits nothing. */
static void store_infinite(const struct slab_band *table, const struct directions *directions, int band, struct slab_slice *slice)
{
	float through[VIEWS][AZIMUTHS];
	fill_depth(table->order2[SLAB_TRANSMITTED][SLAB_DEPTH_COUNT - 1], directions, through);
	for (int view = 0; view < VIEWS; view++)
		for (int i = 0; i < AZIMUTHS; i++)
			slice->k[SLAB_DEPTH_COUNT][view][i][band] =
				slice->side == SLAB_TRANSMITTED
					? 0
					: slice->k[SLAB_DEPTH_COUNT - 1][view][i][band] + fmaxf(through[view][i], 0);
}

void slab_slice_fill(const struct slab_solution *solution, enum slab_side side, double mu_l, const double depth_ratio[BAND_COUNT],
		     struct slab_slice *slice)
{
	struct directions directions;
	float depths[SLAB_DEPTH_COUNT][VIEWS][AZIMUTHS];
	slice->mu_l = fmin(fmax(mu_l, 0), 1);
	slice->side = side;
	fill_directions(solution, slice->mu_l, &directions);
	for (int band = 0; band < BAND_COUNT; band++) {
		const struct slab_band *table = &solution->band[band];
		const double shift = slab_depth_coordinate(depth_ratio[band]) - slab_depth_coordinate(1);
		slice->depth_ratio[band] = depth_ratio[band];
		for (int depth = 0; depth < SLAB_DEPTH_COUNT; depth++)
			fill_depth(table->order2[side][depth], &directions, depths[depth]);
		for (int depth = 0; depth < SLAB_DEPTH_COUNT; depth++)
			store_depth(depths, depth, shift, band, slice);
		store_infinite(table, &directions, band, slice);
	}
}

/* Neighbour below and the share of the one above. */
static int split(double x, int count, double *share)
{
	int low = (int)x < count - 2 ? (int)x : count - 2;
	*share = x - low;
	return low;
}

double slab_slice_depth(const struct slab_solution *solution, double tau)
{
	return slab_depth_coordinate(tau) + 1 - slab_thick_share(&solution->band[1], tau);
}

double slab_slice_radiance(const struct slab_solution *solution, const struct slab_slice *slice, int band, double tau, double mu_v,
			   double azimuth)
{
	double share[3], sum = 0;
	mu_v = fmin(fmax(mu_v, 0), 1);
	tau = fmin(fmax(tau, 0), 1e30);
	azimuth = isfinite(azimuth) ? azimuth : 0;
	int depth = split(slab_slice_depth(solution, tau), SLAB_SLICE_DEPTH_COUNT, &share[0]);
	int view = split(slab_slice_view(mu_v), VIEWS, &share[1]);
	int column = split(slab_slice_azimuth_index(cos(azimuth)), AZIMUTHS, &share[2]);
	for (int corner = 0; corner < 8; corner++) {
		int a = corner & 1, b = corner >> 1 & 1, c = corner >> 2;
		double weight = (a ? share[0] : 1 - share[0]) * (b ? share[1] : 1 - share[1]) * (c ? share[2] : 1 - share[2]);
		sum += weight * slice->k[depth + a][view + b][column + c][band];
	}
	return sum * slab_multiple_scale(&solution->band[band], tau * slice->depth_ratio[band], slice->mu_l, mu_v);
}
