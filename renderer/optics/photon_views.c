#include "renderer/optics/photon_views.h"

#include "renderer/log.h"

#include <stdlib.h>
#include <string.h>

enum {
	BLOCK = 8,   /* lanes estimated together, as the compiler's vectors like it */
	LEG_MAX = 64 /* of a ray; half of the rays end at every scattering, so that no ray is ever longer */
};

/* A straight piece of a ray, as light runs along it towards the viewer; levels are distances from the side it leaves by. */
struct leg {
	float low, high, x, y, z, weight; /* 1/(4 pi |z|) */
	int view, turns;                  /* turns between it and the viewer */
};

struct photon_views {
	const struct photon_phase *phase;
	double tau;
	int view_count, azimuth_count, lane_count, order_count;
	float *mu;
	float *cosine, *sine, *mirror; /* per lane, of its azimuth; mirror: sign of y. All 0 for lanes that only fill a block. */
	float *x, *y;                  /* per lane, the photon's direction turned by it */
	float *square;                 /* per lane, of the sine or cosine of half the scattering angle */
	int32_t *bin;                  /* and its bin of photon_phase.body */

	struct leg *leg[SLAB_SIDE_COUNT]; /* of all views */
	int leg_count[SLAB_SIDE_COUNT];
	float reach[SLAB_SIDE_COUNT]; /* level that no leg passes */
	float *sum;                   /* [order][side][view][lane] of this photon */
	bool *touched;                /* [order][side][view] */
};

/* --- memory -------------------------------------------------------------------------------------------------------------------- */

static bool allocate(struct photon_views *views)
{
	size_t lanes = (size_t)views->lane_count, estimates = (size_t)views->order_count * (size_t)(SLAB_SIDE_COUNT * views->view_count);
	views->mu = calloc((size_t)views->view_count, sizeof *views->mu);
	views->cosine = calloc(6 * lanes, sizeof *views->cosine);
	views->bin = calloc(lanes, sizeof *views->bin);
	views->sum = calloc(estimates * lanes, sizeof *views->sum);
	views->touched = calloc(estimates, sizeof *views->touched);
	for (int side = 0; side < SLAB_SIDE_COUNT; side++)
		views->leg[side] = calloc((size_t)views->view_count * LEG_MAX, sizeof *views->leg[side]);
	if (!views->mu || !views->cosine || !views->bin || !views->sum || !views->touched || !views->leg[0] || !views->leg[1])
		return false;
	views->sine = views->cosine + lanes;
	views->mirror = views->sine + lanes;
	views->x = views->mirror + lanes;
	views->y = views->x + lanes;
	views->square = views->y + lanes;
	return true;
}

struct photon_views *photon_views_create(const struct photon_phase *phase, double tau, int view_count, const double *mu, int azimuth_count,
					 const double *azimuth, int order_count)
{
	struct photon_views *views = calloc(1, sizeof *views);
	if (views) {
		*views = (struct photon_views){
			.phase = phase, .tau = tau, .view_count = view_count, .azimuth_count = azimuth_count, .order_count = order_count};
		views->lane_count = (2 * azimuth_count + BLOCK - 1) / BLOCK * BLOCK;
	}
	if (!views || !allocate(views)) {
		log_error("photons: out of memory");
		photon_views_destroy(views);
		return NULL;
	}
	for (int view = 0; view < view_count; view++)
		views->mu[view] = (float)fmin(fmax(mu[view], 1e-3), 1);
	for (int lane = 0; lane < 2 * azimuth_count; lane++) {
		double angle = azimuth[lane % azimuth_count];
		views->cosine[lane] = (float)cos(isfinite(angle) ? angle : 0);
		views->sine[lane] = (float)sin(isfinite(angle) ? angle : 0);
		views->mirror[lane] = lane < azimuth_count ? 1 : -1;
	}
	return views;
}

void photon_views_destroy(struct photon_views *views)
{
	if (!views)
		return;
	free(views->mu);
	free(views->cosine);
	free(views->bin);
	free(views->sum);
	free(views->touched);
	for (int side = 0; side < SLAB_SIDE_COUNT; side++)
		free(views->leg[side]);
	free(views);
}

/* --- rays ---------------------------------------------------------------------------------------------------------------------- */

static void trace_ray(struct photon_views *views, enum slab_side side, int view, struct photon_random *random)
{
	double mu = views->mu[view], light[3] = {sqrt(1 - mu * mu), 0, mu}, level = 0;
	for (int i = 0; i < LEG_MAX; i++) {
		double next = level + photon_random_path(random) * light[2];
		struct leg *leg = &views->leg[side][views->leg_count[side]++];
		*leg = (struct leg){
			.low = (float)fmin(level, next),
			.high = (float)fmax(level, next),
			.x = (float)light[0],
			.y = (float)light[1],
			.z = (float)light[2],
			.weight = (float)(1 / (4 * M_PI * fabs(light[2]))),
			.view = view,
			.turns = i,
		};
		views->reach[side] = fmaxf(views->reach[side], leg->high);
		if (next < 0 || next > views->tau)
			return;
		struct photon_angle angle = photon_phase_draw(views->phase, random);
		if (!angle.peak)
			return;
		photon_turn(light, angle, random);
		level = next;
	}
}

void photon_views_aim(struct photon_views *views, struct photon_random *random)
{
	for (int side = 0; side < SLAB_SIDE_COUNT; side++) {
		views->leg_count[side] = 0;
		views->reach[side] = 0;
		for (int view = 0; view < views->view_count; view++)
			trace_ray(views, (enum slab_side)side, view, random);
	}
}

/* --- estimates ----------------------------------------------------------------------------------------------------------------- */

/* P without the peak for light of all lanes to be turned into the leg, added to sum. By the length of the vectors' difference (their sum in
 * the back), which unlike the cosine is exact at both ends. The first loop is one for the compiler's vectors. */
static void add_body(const struct photon_views *views, const struct leg *leg, float z, float *restrict sum)
{
	const struct photon_phase *phase = views->phase;
	const float *restrict x = views->x, *restrict y = views->y;
	float *restrict square = views->square;
	int32_t *restrict bin = views->bin;
	const int lanes = views->lane_count;
	const float leg_x = leg->x, leg_y = leg->y, leg_z = leg->z, edge = phase->edge;
	const float front_per_step = phase->front_per_step, back_per_step = phase->back_per_step;
	for (int lane = 0; lane < lanes; lane++) {
		float dot = x[lane] * leg_x + y[lane] * leg_y + z * leg_z, sign = copysignf(1, dot);
		float dx = x[lane] - sign * leg_x, dy = y[lane] - sign * leg_y, dz = z - sign * leg_z;
		float sin_or_cos2 = 0.25F * (dx * dx + dy * dy + dz * dz), half = sqrtf(sin_or_cos2);
		float front = PHOTON_BODY_FRONT + (half - edge) * front_per_step, back = PHOTON_BODY_BACK + half * back_per_step;
		float place = dot > 0 ? front : back;
		square[lane] = sin_or_cos2;
		bin[lane] = (int32_t)(place > 0 ? place : 0);
	}
	for (int lane = 0; lane < lanes; lane++) {
		struct photon_line line = phase->body[bin[lane]];
		sum[lane] += leg->weight * (line.offset + line.slope * square[lane]);
	}
}

/* Row of estimates for light that is scattered `order` times before it is seen. */
static int row_of(const struct photon_views *views, int order, enum slab_side side, int view)
{
	int slot = order < views->order_count ? order - 1 : views->order_count - 1;
	return (slot * SLAB_SIDE_COUNT + (int)side) * views->view_count + view;
}

static int scatter_wide(struct photon_views *views, enum slab_side side, float level, float z, int order)
{
	int estimates = 0;
	for (int i = 0; i < views->leg_count[side]; i++) {
		const struct leg *leg = &views->leg[side][i];
		if (level < leg->low || level >= leg->high)
			continue;
		int row = row_of(views, order + leg->turns, side, leg->view);
		views->touched[row] = true;
		float *sum = &views->sum[(size_t)row * (size_t)views->lane_count];
		add_body(views, leg, z, sum);
		estimates += views->lane_count;
	}
	return estimates;
}

/* The plain estimate by the peak alone. */
static void add_peak(struct photon_views *views, int row, float mu, float z, float weight)
{
	float across = sqrtf(1 - mu * mu), edge = views->phase->edge;
	for (int lane = 0; lane < 2 * views->azimuth_count; lane++) {
		float dx = views->x[lane] - across, dy = views->y[lane], dz = z - mu;
		float square = 0.25F * (dx * dx + dy * dy + dz * dz);
		if (square >= edge * edge)
			continue;
		struct photon_line line = views->phase->peak[(int)(sqrtf(square) * views->phase->peak_per_step)];
		views->sum[(size_t)row * (size_t)views->lane_count + (size_t)lane] += weight * (line.offset + line.slope * square);
		views->touched[row] = true;
	}
}

static int scatter_straight(struct photon_views *views, enum slab_side side, float level, float z, int order)
{
	int estimates = 0;
	for (int view = 0; view < views->view_count; view++) {
		float mu = views->mu[view], path = level / mu;
		if (fabsf(mu - z) > 2 * views->phase->edge || path > 80)
			continue;
		add_peak(views, row_of(views, order, side, view), mu, z, expf(-path) / ((float)(4 * M_PI) * mu));
		estimates += views->lane_count;
	}
	return estimates;
}

int photon_views_scatter(struct photon_views *views, double depth, const double direction[3], bool straight, int order)
{
	float level[] = {(float)depth, (float)(views->tau - depth)};
	bool seen[] = {level[0] < views->reach[0], level[1] < views->reach[1]};
	if (!seen[0] && !seen[1] && !straight)
		return 0;
	for (int lane = 0; lane < views->lane_count; lane++) {
		float x = (float)direction[0], y = views->mirror[lane] * (float)direction[1];
		views->x[lane] = x * views->cosine[lane] + y * views->sine[lane];
		views->y[lane] = y * views->cosine[lane] - x * views->sine[lane];
	}
	int estimates = 0;
	for (int side = 0; side < SLAB_SIDE_COUNT; side++) {
		float z = (float)(side == SLAB_REFLECTED ? -direction[2] : direction[2]);
		if (seen[side])
			estimates += scatter_wide(views, (enum slab_side)side, level[side], z, order);
		if (straight)
			estimates += scatter_straight(views, (enum slab_side)side, level[side], z, order);
	}
	return estimates;
}

/* Adds all orders to the first. */
static void collect_orders(struct photon_views *views, double *order_sum)
{
	const int rows = SLAB_SIDE_COUNT * views->view_count;
	for (int row = 0; row < views->order_count * rows; row++) {
		if (!views->touched[row])
			continue;
		float *lane = &views->sum[(size_t)row * (size_t)views->lane_count];
		float *first = &views->sum[(size_t)(row % rows) * (size_t)views->lane_count];
		for (int i = 0; i < views->azimuth_count; i++)
			order_sum[(size_t)row * (size_t)views->azimuth_count + (size_t)i] +=
				0.5 * ((double)lane[i] + (double)lane[views->azimuth_count + i]);
		if (row < rows)
			continue;
		for (int i = 0; i < views->lane_count; i++)
			first[i] += lane[i];
		memset(lane, 0, (size_t)views->lane_count * sizeof *lane);
		views->touched[row % rows] = true;
		views->touched[row] = false;
	}
}

void photon_views_collect(struct photon_views *views, double *sum, double *square, double *order_sum)
{
	if (order_sum)
		collect_orders(views, order_sum);
	for (int row = 0; row < SLAB_SIDE_COUNT * views->view_count; row++) {
		if (!views->touched[row])
			continue;
		float *lane = &views->sum[(size_t)row * (size_t)views->lane_count];
		size_t first = (size_t)row * (size_t)views->azimuth_count;
		for (int i = 0; i < views->azimuth_count; i++) {
			double value = 0.5 * ((double)lane[i] + (double)lane[views->azimuth_count + i]);
			sum[first + (size_t)i] += value;
			square[first + (size_t)i] += value * value;
		}
		memset(lane, 0, (size_t)views->lane_count * sizeof *lane);
		views->touched[row] = false;
	}
}
