#include "renderer/optics/slab.h"

#include "renderer/log.h"
#include "renderer/optics/slab_layer.h"
#include "renderer/optics/slab_residual.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

enum {
	N = LAYER_SIZE,
	E = LAYER_OUTPUT,
	OCTAVE_PARTS = 4,   /* starting depths, interleaved */
	THIN_DOUBLINGS = 7, /* of the start, to SLAB_DEPTH_MIN and its like */
	MODE_TASKS = BAND_COUNT * SLAB_MODE_COUNT,
	TASK_COUNT = MODE_TASKS + BAND_COUNT * SLAB_SIDE_COUNT,
	THREAD_MAX = 16
};

_Static_assert((int)SLAB_NODE_COUNT == (int)LAYER_OUTPUT && SLAB_DEPTH_COUNT % OCTAVE_PARTS == 0, "sizes fit");

/* Largest matrix element of a transmittance that is nothing; it enters reflection squared. */
#define OPAQUE 1e-7

struct job {
	const struct optics *optics;
	struct slab_solution *solution;
	struct layer_nodes nodes;
	double moment[BAND_COUNT][LAYER_MOMENTS]; /* of P_D */
	double asymmetry[BAND_COUNT][SLAB_MODE_COUNT];
	atomic_int next;
};

double slab_depth(double coordinate)
{
	return SLAB_DEPTH_MIN * exp2(coordinate / OCTAVE_PARTS);
}

double slab_depth_coordinate(double tau)
{
	double coordinate = OCTAVE_PARTS * log2(fmax(tau, SLAB_DEPTH_MIN) / SLAB_DEPTH_MIN);
	return fmin(coordinate, SLAB_DEPTH_COUNT - 1);
}

/* Delta-M. A moment below 0 (of droplets much smaller than the wavelength) takes nothing out. */
static void truncate_moments(struct job *job, int band)
{
	const double *moment = job->optics->moment[band];
	double f = fmin(fmax(moment[LAYER_MOMENTS], 0), 0.9);
	job->solution->band[band].truncated = f;
	job->solution->band[band].asymmetry = 0;
	for (int l = 0; l < LAYER_MOMENTS; l++)
		job->moment[band][l] = (moment[l] - f) / (1 - f);
}

/* Stores K_m of a depth: all orders less the first, by its closed forms. Returns the largest difference that reciprocity forbids. */
static double store_mode(const struct job *job, int band, int mode, int index, const struct slab_layer *layer,
			 const struct layer_scattering *scattering)
{
	struct slab_band *result = &job->solution->band[band];
	const double *mu = job->nodes.output_mu;
	double worst = 0, depth = layer->depth;
	for (int i = 0, pair = 0; i < E; i++)
		for (int j = 0; j <= i; j++, pair++) {
			double a = depth / mu[i], b = depth / mu[j];
			double scale = 2 * sqrt(mu[i] * mu[j]) * (1 - layer->direct[i]) * (1 - layer->direct[j]);
			double square = (1 - mu[i] * mu[i]) * (1 - mu[j] * mu[j]);
			scale *= mode == 0 ? 1 : mode % 2 ? sqrt(square) : square;
			double factor = (mode > 0 ? 2 : 1) / scale;
			double r = (layer->r_through[i][j] + layer->r_through[j][i]) / 2;
			double t = (layer->t_through[i][j] + layer->t_through[j][i]) / 2;
			double single_r = scattering->backward_through[i][j] * depth / (a + b) * -expm1(-a - b);
			double single_t = scattering->forward_through[i][j] * depth * slab_mean_attenuation(a, b);
			result->order2[SLAB_REFLECTED][index][mode][pair] = (float)((r - single_r) * factor);
			result->order2[SLAB_TRANSMITTED][index][mode][pair] = (float)((t - single_t) * factor);
			double size = fabs(r) + fabs(t) + 1e-9;
			worst = fmax(worst, fabs(layer->r_through[i][j] - layer->r_through[j][i]) / size);
			worst = fmax(worst, fabs(layer->t_through[i][j] - layer->t_through[j][i]) / size);
		}
	return worst;
}

/* Fluxes of a depth, from mode 0: of light falling in along an output direction, and of uniform light. */
static void store_fluxes(const struct job *job, int band, int index, const struct slab_layer *layer)
{
	struct slab_band *result = &job->solution->band[band];
	const struct layer_nodes *nodes = &job->nodes;
	double spherical_r = 0, spherical_t = 0;
	for (int j = 0; j < E; j++) {
		double r = 0, t = 0;
		for (int i = 0; i < N; i++) {
			double out = sqrt(nodes->weight[i] * nodes->mu[i] / nodes->output_mu[j]);
			r += out * layer->r_in[i][j];
			t += out * layer->t_in[i][j];
		}
		result->flux[SLAB_REFLECTED][index][j] = r / (1 - layer->direct[j]);
		result->flux[SLAB_TRANSMITTED][index][j] = t / (1 - layer->direct[j]);
		spherical_r += 2 * nodes->output_weight[j] * nodes->output_mu[j] * r;
		spherical_t += 2 * nodes->output_weight[j] * nodes->output_mu[j] * (t + layer->direct[j]);
	}
	result->spherical[SLAB_REFLECTED][index] = spherical_r;
	result->spherical[SLAB_TRANSMITTED][index] = spherical_t;
}

static void solve_mode(struct job *job, int band, int mode)
{
	struct layer_scattering scattering;
	layer_scattering_fill(&job->nodes, mode, job->moment[band], &scattering);
	double scale = 1 - job->solution->band[band].truncated, worst = 0;
	for (int part = 0; part < OCTAVE_PARTS; part++) {
		struct slab_layer layer;
		bool opaque = false; /* higher modes are long before the last depth */
		layer_start(&layer, &job->nodes, &scattering, scale * ldexp(slab_depth(part), -THIN_DOUBLINGS));
		for (int i = 0; i < THIN_DOUBLINGS; i++)
			layer_double(&layer, &job->nodes);
		for (int index = part; index < SLAB_DEPTH_COUNT; index += OCTAVE_PARTS) {
			if (index > part && !opaque)
				layer_double(&layer, &job->nodes);
			else if (index > part)
				layer_deepen(&layer, &job->nodes);
			opaque = opaque || layer_transmits(&layer) < OPAQUE;
			worst = fmax(worst, store_mode(job, band, mode, index, &layer, &scattering));
			if (mode == 0)
				store_fluxes(job, band, index, &layer);
		}
	}
	job->asymmetry[band][mode] = worst;
}

static void *worker_main(void *argument)
{
	struct job *job = argument;
	for (int task; (task = atomic_fetch_add(&job->next, 1)) < TASK_COUNT;) {
		if (task < MODE_TASKS)
			solve_mode(job, task % BAND_COUNT, task / BAND_COUNT);
		else
			slab_residual_fill(job->optics, (task - MODE_TASKS) / SLAB_SIDE_COUNT,
					   (enum slab_side)((task - MODE_TASKS) % SLAB_SIDE_COUNT),
					   &job->solution->band[(task - MODE_TASKS) / SLAB_SIDE_COUNT]);
	}
	return NULL;
}

/* Transmittance of thick layers is 1/(a (tau + q)): q from the two deepest layers that are an octave apart. */
static void finish_band(const struct job *job, int band)
{
	struct slab_band *result = &job->solution->band[band];
	const double *spherical = result->spherical[SLAB_TRANSMITTED];
	int deep = SLAB_DEPTH_COUNT - 1, half = deep - OCTAVE_PARTS;
	double slope = (1 / spherical[deep] - 1 / spherical[half]) / (slab_depth(deep) - slab_depth(half));
	result->extrapolation = 1 / (spherical[deep] * slope) - slab_depth(deep);
	for (int mode = 0; mode < SLAB_MODE_COUNT; mode++)
		result->asymmetry = fmax(result->asymmetry, job->asymmetry[band][mode]);
}

static bool all_finite(const struct slab_band *band)
{
	float sum = 0; /* 0 times anything finite */
	const float *order2 = &band->order2[0][0][0][0], *residual = &band->residual[0][0][0];
	for (size_t i = 0; i < sizeof band->order2 / sizeof *order2; i++)
		sum += 0 * order2[i];
	for (size_t i = 0; i < sizeof band->residual / sizeof *residual; i++)
		sum += 0 * residual[i];
	for (int side = 0; side < SLAB_SIDE_COUNT; side++)
		for (int index = 0; index < SLAB_DEPTH_COUNT; index++) {
			sum += 0 * (float)band->spherical[side][index];
			for (int i = 0; i < E; i++)
				sum += 0 * (float)band->flux[side][index][i];
		}
	return sum == 0 && isfinite(band->extrapolation);
}

bool slab_solve_into(const struct optics *optics, int threads, struct slab_solution *solution)
{
	struct job job = {.optics = optics, .solution = solution};
	layer_nodes_fill(&job.nodes);
	memcpy(job.solution->mu, job.nodes.output_mu, sizeof job.solution->mu);
	memcpy(job.solution->weight, job.nodes.output_weight, sizeof job.solution->weight);
	for (int band = 0; band < BAND_COUNT; band++)
		truncate_moments(&job, band);

	pthread_t thread[THREAD_MAX];
	int started = 0, wanted = threads < THREAD_MAX ? threads : THREAD_MAX;
	while (started < wanted - 1 && pthread_create(&thread[started], NULL, worker_main, &job) == 0)
		started++;
	worker_main(&job);
	for (int i = 0; i < started; i++)
		pthread_join(thread[i], NULL);

	bool finite = true;
	for (int band = 0; band < BAND_COUNT; band++) {
		finish_band(&job, band);
		finite = finite && all_finite(&job.solution->band[band]);
	}
	if (!finite)
		log_error("slab: the solution is not finite");
	return finite;
}

struct slab_solution *slab_solve(const struct optics *optics, int threads)
{
	struct slab_solution *solution = malloc(sizeof *solution);
	if (!solution) {
		log_error("slab: out of memory");
		return NULL;
	}
	if (slab_solve_into(optics, threads, solution))
		return solution;
	slab_destroy(solution);
	return NULL;
}

void slab_destroy(struct slab_solution *solution)
{
	free(solution);
}

int slab_vector_bytes(void)
{
	return layer_vector_bytes();
}
