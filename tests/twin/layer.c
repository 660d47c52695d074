#include "tests/twin/layer.h"

#include "renderer/scene.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 8, BASE_M = 1000, BOUNDS_SIDE = 64, ROUNDS = 4 };

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
