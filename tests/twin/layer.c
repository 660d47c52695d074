#include "tests/twin/layer.h"

#include "renderer/scene.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 8, BASE_M = 1000, BOUNDS_SIDE = 64, ROUNDS = 4, FLUX_ZENITHS = 12, FLUX_AZIMUTHS = 24 };

/* Asymmetry of the lobe in which half of the directions are drawn that irradiance is made of. */
static const double FLUX_LOBE = 0.95;

static void set_texture(struct twin *twin, enum twin_sampler sampler, const float *texels, int width, int height, bool repeat, bool nearest)
{
	twin->texture[sampler] = (struct twin_texture){
		.width = width, .height = height, .levels = 1, .repeat = repeat, .nearest = nearest, .level = {texels}};
}

static void fill4(float to[4], double value)
{
	for (int i = 0; i < 4; i++)
		to[i] = (float)value;
}

static void fill_textures(struct uniform_layer *layer)
{
	struct twin *twin = &layer->twin;
	const struct layer_case *is = &layer->is;
	fill4(layer->top, is->thickness_m);
	fill4(layer->white, 1);
	fill4(layer->sky[0], is->sky); /* over the horizon; below it there is no air */
	fill4(layer->ground, is->ground_albedo);
	layer->identity[0] = layer->identity[1] = layer->identity[2] = 1;
	for (int sampler = 0; sampler < TWIN_SAMPLER_COUNT; sampler++)
		set_texture(twin, sampler, layer->black, 1, 1, true, true);
	set_texture(twin, TWIN_TRANSMITTANCE, layer->identity, 1, 1, true, true);
	set_texture(twin, TWIN_AIR_TO_LAYER, layer->white, 1, 1, true, true);
	set_texture(twin, TWIN_AIR_TO_END, layer->white, 1, 1, true, true);
	set_texture(twin, TWIN_SKY_TOTAL, layer->sky[0], 1, 2, false, true);
	set_texture(twin, TWIN_SKY_AT_LAYER, layer->sky[0], 1, 1, true, true);
	set_texture(twin, TWIN_SKY_AT_GROUND, layer->sky[0], 1, 1, true, true);
	set_texture(twin, TWIN_GROUND, layer->ground, 1, 1, true, true);
	set_texture(twin, TWIN_TOPS, layer->top, 1, 1, true, true);
	set_texture(twin, TWIN_BOUNDS, layer->bounds, BOUNDS_SIDE, BOUNDS_SIDE, true, true);
	set_texture(twin, TWIN_PHASE, layer->phase, DROPLET_PHASE_COLUMNS, 2, false, false);
	set_texture(twin, TWIN_INVERSE, &layer->inverse->unit[0][0], PATH_INVERSE_COLUMNS, 1, false, false);
	set_texture(twin, TWIN_CHAINS, &layer->chains->chain[0][0][0][0][0], PATH_CHAINS_A_ROW * PATH_CHAIN_LENGTH,
		    BAND_COUNT * PATH_CHAIN_ROWS, false, true);
}

static void fill_block(struct uniform_layer *layer)
{
	struct scene_block *block = &layer->twin.block;
	const struct optics *optics = layer->is.tables->optics;
	const double zenith = layer->is.sun_zenith_deg * M_PI / 180;
	block->sun_direction[0] = (float)sin(zenith);
	block->sun_direction[2] = (float)cos(zenith);
	block->sun_direction[3] = 0.00465f;
	for (int band = 0; band < 3; band++) {
		block->solar_irradiance[band] = layer->is.sun;
		block->extinction[band] = (float)optics->extinction_per_m[band];
		block->extinction_modified[band] = (float)(optics->extinction_per_m[band] * (1 - optics->forward_peak_fraction[band]));
		block->air_below[band] = 1;
	}
	block->band_red[0] = block->band_green[1] = block->band_blue[2] = 1; /* colors are bands */
	block->cloud_layer[0] = BASE_M;
	block->cloud_layer[1] = (float)layer->is.thickness_m;
	block->cloud_layer[2] = 10000;
	block->cloud_layer[3] = 1;
	block->ground_patch[0] = block->ground_patch[3] = 1;
	block->ground_mean_albedo[3] = 10000;
	block->aerosol[3] = block->rayleigh[3] = 1;
	block->image_size[0] = block->image_size[1] = SIDE;
	block->image_size[2] = block->image_size[3] = 1.0f / SIDE;
}

void layer_init(struct uniform_layer *layer, const struct layer_case *is)
{
	*layer = (struct uniform_layer){.is = *is};
	layer->inverse = malloc(sizeof *layer->inverse);
	layer->chains = malloc(sizeof *layer->chains);
	layer->phase = calloc((size_t)2 * DROPLET_PHASE_COLUMNS * 4, sizeof *layer->phase);
	layer->bounds = malloc(sizeof(float[BOUNDS_SIDE][BOUNDS_SIDE][4]));
	assert(layer->inverse && layer->chains && layer->phase && layer->bounds);
	for (int i = 0; i < BOUNDS_SIDE * BOUNDS_SIDE; i++)
		fill4(layer->bounds + 4 * i, is->thickness_m);
	for (int row = 0; row < 2; row++)
		for (int i = 0; i < DROPLET_PHASE_COLUMNS; i++)
			for (int band = 0; band < 3; band++)
				layer->phase[4 * (row * DROPLET_PHASE_COLUMNS + i) + band] = is->tables->phase[row][i][band];
	path_inverse_fill(layer->inverse, is->tables);
	fill_textures(layer);
	fill_block(layer);
	layer->twin.paths = SCENE_PATHS_ALL;
	for (int i = 0; i < TWIN_LAYERS; i++)
		layer->twin.layer[i] = -1;
}

void layer_finish(struct uniform_layer *layer)
{
	free(layer->bounds);
	free(layer->phase);
	free(layer->chains);
	free(layer->inverse);
}

/* Along the direction with hardly a field of view. The beam goes towards -x. */
static void look(struct uniform_layer *layer, bool above, double mu_v, double azimuth)
{
	struct scene_block *block = &layer->twin.block;
	const double sine = sqrt(1 - mu_v * mu_v);
	/* Light that reaches the viewer goes against the direction of view. */
	const double ahead[3] = {sine * cos(azimuth), sine * sin(azimuth), above ? -mu_v : mu_v};
	const double right[3] = {-sin(azimuth), cos(azimuth), 0};
	for (int i = 0; i < 3; i++) {
		block->camera_forward[i] = (float)ahead[i];
		block->camera_right[i] = (float)right[i];
	}
	block->camera_up[0] = (float)(-ahead[2] * cos(azimuth));
	block->camera_up[1] = (float)(-ahead[2] * sin(azimuth));
	block->camera_up[2] = (float)sine;
	block->camera_right[3] = block->camera_up[3] = 1e-4f;
	block->camera_position[2] = above ? BASE_M + block->cloud_layer[1] + 1 : BASE_M - 1;
	block->camera_position[3] = 2e-4f / SIDE;
	layer->twin.above = above;
}

struct layer_seen layer_see(struct uniform_layer *layer, bool above, double mu_v, double azimuth, int samples, int threads)
{
	static float color[SIDE * SIDE * 4], squares[SIDE * SIDE * 4];
	float *outputs[TWIN_OUTPUTS] = {color, NULL, squares};
	struct layer_seen seen;
	memset(color, 0, sizeof color);
	memset(squares, 0, sizeof squares);
	look(layer, above, mu_v, azimuth);
	const int each = (samples + ROUNDS * SIDE * SIDE - 1) / (ROUNDS * SIDE * SIDE);
	const double count = (double)each * ROUNDS * SIDE * SIDE;
	for (int round = 0; round < ROUNDS; round++) {
		path_chains_draw(layer->chains, layer->is.tables, layer->twin.block.sun_direction[3], 1, (uint64_t)(layer->rounds++));
		twin_run(&layer->twin, SIDE, SIDE, round * each, each, threads, outputs);
	}
	layer->twin.seed++;
	for (int band = 0; band < 3; band++) {
		double sum = 0, square = 0;
		for (int i = 0; i < SIDE * SIDE; i++) {
			sum += color[4 * i + band];
			square += squares[4 * i + band];
		}
		seen.mean[band] = sum / count;
		seen.error[band] = sqrt(fmax(0, square / count - seen.mean[band] * seen.mean[band]) / (count - 1));
	}
	return seen;
}

/* 0..1, by the numbers of a thing and of what is asked of it. */
static double even_unit(uint32_t number, uint32_t dimension)
{
	uint32_t hash = (number + 1) * 0x9e3779b9u ^ (dimension + 1) * 0x85ebca6bu;
	for (int i = 0; i < 2; i++)
		hash = (hash ^ hash >> 16) * 0x7feb352du;
	return ((hash ^ hash >> 15) >> 8) * 0x1p-24;
}

/* Density per solid angle about the beam's direction (Henyey and Greenstein 1941): where thin layers send most of what comes through. */
static double lobe_density(double cosine)
{
	return (1 - FLUX_LOBE * FLUX_LOBE) / (4 * M_PI * pow(1 + FLUX_LOBE * FLUX_LOBE - 2 * FLUX_LOBE * cosine, 1.5));
}

/* Directions in which light goes, the beam towards -x and down: even in irradiance, on one side of the layer; and of the lobe. */
static void flux_direction(double share, double around, bool above, double to[3])
{
	const double sine = sqrt(1 - share), mu = fmax(sqrt(share), 1e-3);
	to[0] = sine * cos(2 * M_PI * around);
	to[1] = sine * sin(2 * M_PI * around);
	to[2] = above ? mu : -mu;
}

static void lobe_direction(const struct uniform_layer *layer, double share, double around, double to[3])
{
	const double g = FLUX_LOBE, zenith = layer->is.sun_zenith_deg * M_PI / 180, spread = (1 - g * g) / (1 - g + 2 * g * share);
	const double cosine = (1 + g * g - spread * spread) / (2 * g), sine = sqrt(fmax(0, 1 - cosine * cosine));
	const double x = sine * cos(2 * M_PI * around);
	to[0] = -cosine * sin(zenith) + x * cos(zenith);
	to[1] = sine * sin(2 * M_PI * around);
	to[2] = -cosine * cos(zenith) - x * sin(zenith);
}

/* Adds what goes one way, weighed by the density of both kinds of directions (balance heuristic). */
static void add_direction(struct uniform_layer *layer, bool above, const double to[3], int each, int threads, double sum[3])
{
	static float color[SIDE * SIDE * 4];
	float *outputs[TWIN_OUTPUTS] = {color};
	const double zenith = layer->is.sun_zenith_deg * M_PI / 180, mu = fabs(to[2]);
	const double density = mu / M_PI + lobe_density(-to[0] * sin(zenith) - to[2] * cos(zenith));
	if ((to[2] > 0) != above)
		return;
	look(layer, above, mu, atan2(-to[1], -to[0]));
	memset(color, 0, sizeof color);
	twin_run(&layer->twin, SIDE, SIDE, 0, each, threads, outputs);
	layer->twin.seed++;
	for (int i = 0; i < SIDE * SIDE; i++)
		for (int band = 0; band < 3; band++)
			sum[band] += mu / density * color[4 * i + band] / ((double)each * SIDE * SIDE * FLUX_ZENITHS * FLUX_AZIMUTHS);
}

static void add_cells(struct uniform_layer *layer, bool above, int replicate, int each, int threads, double sum[3])
{
	for (int i = 0; i < 2 * FLUX_ZENITHS * FLUX_AZIMUTHS; i++) {
		const uint32_t number = (uint32_t)(2 * replicate * FLUX_ZENITHS * FLUX_AZIMUTHS + i);
		const int cell = i / 2;
		const double share = (cell % FLUX_ZENITHS + even_unit(number, 0)) / FLUX_ZENITHS;
		const double around = (cell / FLUX_ZENITHS + even_unit(number, 1)) / FLUX_AZIMUTHS;
		double to[3];
		if (i % 2)
			lobe_direction(layer, share, around, to);
		else
			flux_direction(share, around, above, to);
		add_direction(layer, above, to, each, threads, sum);
	}
}

struct layer_seen layer_irradiance(struct uniform_layer *layer, bool above, int replicates, int samples, int threads)
{
	struct layer_seen seen = {{0}, {0}};
	const int each = (int)fmax(1, round((double)samples / replicates / (2 * SIDE * SIDE * FLUX_ZENITHS * FLUX_AZIMUTHS)));
	for (int n = 0; n < replicates; n++) {
		double sum[3] = {0};
		path_chains_draw(layer->chains, layer->is.tables, layer->twin.block.sun_direction[3], 1, (uint64_t)(layer->rounds++));
		add_cells(layer, above, n, each, threads, sum);
		for (int band = 0; band < 3; band++) {
			const double off = sum[band] - seen.mean[band];
			seen.mean[band] += off / (n + 1);
			seen.error[band] += off * (sum[band] - seen.mean[band]);
		}
	}
	for (int band = 0; band < 3; band++)
		seen.error[band] = sqrt(seen.error[band] / (replicates - 1) / replicates);
	return seen;
}
