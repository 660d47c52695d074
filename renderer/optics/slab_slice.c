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
	float view[VIEWS][N];     /* of even modes */
	float view_odd[VIEWS][N]; /* times both sines */
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
			directions->view[view][i] = (float)factor[i];
			directions->view_odd[view][i] = (float)(sines * factor[i]);
		}
	}
	for (int mode = 0; mode < MODES; mode++)
		for (int i = 0; i < AZIMUTHS; i++)
			directions->cosine[mode][i] = (float)cos(mode * M_PI * i / (AZIMUTHS - 1));
}

/* K of one depth, over views and azimuths. */
static void fill_depth(const float order2[MODES][SLAB_PAIR_COUNT], const struct directions *directions, float k[VIEWS][AZIMUTHS])
{
	memset(k, 0, VIEWS * sizeof *k);
	for (int mode = 0; mode < MODES; mode++) {
		float lit[N] = {0};
		const float *pair = order2[mode];
		for (int i = 0; i < N; i++) {
			for (int j = 0; j < i; j++, pair++) {
				lit[i] += directions->sun[j] * *pair;
				lit[j] += directions->sun[i] * *pair;
			}
			lit[i] += directions->sun[i] * *pair++;
		}
		for (int view = 0; view < VIEWS; view++) {
			const float *factor = mode % 2 ? directions->view_odd[view] : directions->view[view];
			float value = 0;
			for (int i = 0; i < N; i++)
				value += factor[i] * lit[i];
			for (int i = 0; i < AZIMUTHS; i++)
				k[view][i] += value * directions->cosine[mode][i];
		}
	}
}

void slab_slice_fill(const struct slab_solution *solution, double mu_l, struct slab_slice *slice)
{
	struct directions directions;
	slice->mu_l = fmin(fmax(mu_l, 0), 1);
	fill_directions(solution, slice->mu_l, &directions);
	for (int side = 0; side < SLAB_SIDE_COUNT; side++)
		for (int depth = 0; depth < SLAB_DEPTH_COUNT; depth++)
			for (int band = 0; band < BAND_COUNT; band++) {
				float k[VIEWS][AZIMUTHS];
				fill_depth(solution->band[band].order2[side][depth], &directions, k);
				for (int view = 0; view < VIEWS; view++)
					for (int i = 0; i < AZIMUTHS; i++)
						slice->k[side][depth][view][i][band] = fmaxf(k[view][i], 0);
			}
}

/* Neighbour below and the share of the one above. */
static int split(double x, int count, double *share)
{
	int low = (int)x < count - 2 ? (int)x : count - 2;
	*share = x - low;
	return low;
}

static double look_up(const struct slab_slice *slice, int band, enum slab_side side, double tau, double mu_v, double azimuth)
{
	double share[3], sum = 0;
	int depth = split(slab_depth_coordinate(tau), SLAB_DEPTH_COUNT, &share[0]);
	int view = split(slab_slice_view(mu_v), VIEWS, &share[1]);
	int column = split(acos(cos(azimuth)) / M_PI * (AZIMUTHS - 1), AZIMUTHS, &share[2]);
	for (int corner = 0; corner < 8; corner++) {
		int a = corner & 1, b = corner >> 1 & 1, c = corner >> 2;
		double weight = (a ? share[0] : 1 - share[0]) * (b ? share[1] : 1 - share[1]) * (c ? share[2] : 1 - share[2]);
		sum += weight * slice->k[side][depth + a][view + b][column + c][band];
	}
	return sum;
}

double slab_slice_radiance(const struct slab_solution *solution, const struct slab_slice *slice, int band, enum slab_side side, double tau,
			   double mu_v, double azimuth)
{
	const struct slab_band *table = &solution->band[band];
	mu_v = fmin(fmax(mu_v, 0), 1);
	tau = fmin(fmax(tau, 0), 1e30);
	azimuth = isfinite(azimuth) ? azimuth : 0;
	double k = look_up(slice, band, side, tau, mu_v, azimuth), share = slab_thick_share(table, tau);
	if (share < 1) {
		double through = look_up(slice, band, SLAB_TRANSMITTED, tau, mu_v, azimuth);
		k += side == SLAB_TRANSMITTED ? (share - 1) * through : (1 - share) * through;
	}
	return k * slab_multiple_scale(table, tau, slice->mu_l, mu_v);
}
