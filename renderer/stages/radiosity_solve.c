#include "renderer/stages/radiosity_solve.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct work {
	struct exchange *exchange;
	const struct radiosity_planes *planes;
	int count;                               /* texels of a plane */
	float *first;                            /* what the ground receives from the base's own light */
	float *irradiance, *residual, *way, *to; /* E; what it misses; direction of the search; what that becomes */
	float *sends;
	double norm[EXCHANGE_BANDS]; /* of the residual, squared */
};

static double mean(const float *values, int count)
{
	double sum = 0;
	for (int i = 0; i < count; i++)
		sum += (double)values[i];
	return sum / count;
}

/* Mean of weight u v. */
static double inner(const float *weight, const float *u, const float *v, int count)
{
	double sum = 0;
	for (int i = 0; i < count; i++)
		sum += (double)(weight[i] * u[i] * v[i]);
	return sum / count;
}

static void multiply(const float *a, const float *b, int count, float *product)
{
	for (int i = 0; i < count; i++)
		product[i] = a[i] * b[i];
}

/* What the base receives for a ground that receives `ground`; that is overwritten. */
static void bounce_up(struct work *work, float *ground, float *base)
{
	multiply(ground, work->planes->ground_albedo, EXCHANGE_BANDS * work->count, ground);
	exchange_receive(work->exchange, EXCHANGE_UP, ground, base);
}

/* What the ground receives by way of a base that receives `base`. */
static void bounce_down(struct work *work, const float *base, float *ground)
{
	multiply(base, work->planes->cloud_albedo, EXCHANGE_BANDS * work->count, work->sends);
	exchange_receive(work->exchange, EXCHANGE_DOWN, work->sends, ground);
}

/* The ground's first light, and what it sends up of it and of the beam. */
static void start(struct work *work)
{
	const int values = EXCHANGE_BANDS * work->count;
	exchange_receive(work->exchange, EXCHANGE_DOWN, work->planes->source, work->first);
	for (int i = 0; i < values; i++)
		work->to[i] = work->first[i] + work->planes->direct[i];
	bounce_up(work, work->to, work->residual);
	memcpy(work->way, work->residual, (size_t)values * sizeof *work->way);
	for (int band = 0; band < EXCHANGE_BANDS; band++) {
		const int at = band * work->count;
		work->norm[band] = inner(work->planes->cloud_albedo + at, work->residual + at, work->residual + at, work->count);
	}
}

/* A step of conjugate gradients, per band. */
static void step(struct work *work)
{
	bounce_down(work, work->way, work->to);
	bounce_up(work, work->to, work->to);
	for (int band = 0; band < EXCHANGE_BANDS; band++) {
		const int at = band * work->count;
		const float *weight = work->planes->cloud_albedo + at;
		float *way = work->way + at, *to = work->to + at, *residual = work->residual + at, *irradiance = work->irradiance + at;
		for (int i = 0; i < work->count; i++)
			to[i] = way[i] - to[i];
		const double curvature = inner(weight, way, to, work->count);
		if (curvature <= 0)
			continue; /* nothing is left, or nothing comes back from the base at all */
		const float length = (float)(work->norm[band] / curvature);
		for (int i = 0; i < work->count; i++) {
			irradiance[i] += length * way[i];
			residual[i] -= length * to[i];
		}
		const double norm = inner(weight, residual, residual, work->count);
		const float turn = work->norm[band] > 0 ? (float)(norm / work->norm[band]) : 0;
		for (int i = 0; i < work->count; i++)
			way[i] = residual[i] + turn * way[i];
		work->norm[band] = norm;
	}
}

/* What the base would send next, root mean square, over all that the ground receives; the largest of the bands. */
static double relative_residual(const struct work *work)
{
	double largest = 0;
	for (int band = 0; band < EXCHANGE_BANDS; band++) {
		const int at = band * work->count;
		const float *albedo = work->planes->cloud_albedo + at, *residual = work->residual + at, *irradiance = work->irradiance + at;
		double squares = 0, sent = 0;
		for (int i = 0; i < work->count; i++) {
			const double still = (double)(albedo[i] * residual[i]);
			squares += still * still;
			sent += (double)(albedo[i] * irradiance[i]) + still;
		}
		const double received =
			mean(work->first + at, work->count) + mean(work->planes->direct + at, work->count) + sent / work->count;
		if (received > 0)
			largest = fmax(largest, sqrt(squares / work->count) / received);
	}
	return largest;
}

static void iterate(struct work *work, double tolerance, int max_passes, struct radiosity_solution *solution)
{
	for (solution->passes = 1;; solution->passes++) {
		const double residual = solution->last_residual = relative_residual(work);
		if (solution->passes <= RADIOSITY_PASSES_LISTED)
			solution->residual[solution->passes - 1] = residual;
		if (residual <= tolerance || solution->passes >= max_passes)
			return;
		step(work);
	}
}

/* One more bounce of what is known, residual included. */
static void finish(struct work *work, struct radiosity_solution *solution)
{
	const int values = EXCHANGE_BANDS * work->count;
	for (int i = 0; i < values; i++)
		work->irradiance[i] += work->residual[i];
	bounce_down(work, work->irradiance, solution->ground_received);
	for (int i = 0; i < values; i++) {
		solution->ground_received[i] += work->first[i];
		work->sends[i] = work->planes->ground_albedo[i] * (solution->ground_received[i] + work->planes->direct[i]);
	}
	exchange_receive(work->exchange, EXCHANGE_LEVEL, work->sends, solution->cloud_received);
}

bool radiosity_solve(struct exchange *exchange, const struct radiosity_planes *planes, double tolerance, int max_passes,
		     struct radiosity_solution *solution)
{
	const int side = exchange->fourier.side, count = side * side, values = EXCHANGE_BANDS * count;
	float *memory = calloc(6 * (size_t)values, sizeof *memory);
	if (!memory)
		return false;
	struct work work = {exchange,
			    planes,
			    count,
			    memory,
			    memory + values,
			    memory + 2 * values,
			    memory + 3 * values,
			    memory + 4 * values,
			    memory + 5 * values,
			    {0}};
	solution->passes = 0;
	solution->last_residual = 0;
	memset(solution->residual, 0, sizeof solution->residual);
	if (max_passes > 0) {
		start(&work);
		iterate(&work, tolerance, max_passes, solution);
		finish(&work, solution);
	} else {
		exchange_receive(exchange, EXCHANGE_DOWN, planes->source, solution->ground_received);
		memset(solution->cloud_received, 0, (size_t)values * sizeof *solution->cloud_received);
	}
	free(memory);
	for (int band = 0; band < EXCHANGE_BANDS; band++) {
		solution->ground_diffuse[band] = mean(solution->ground_received + band * count, count);
		solution->ground_direct[band] = mean(planes->direct + band * count, count);
	}
	return true;
}
