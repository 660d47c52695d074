#include "renderer/stages/radiosity.h"

#include "renderer/log.h"
#include "renderer/stages/exchange.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PASS_CLOUD, PASS_GROUND };

static const struct pass_desc pass_descs[RADIOSITY_PASS_COUNT] = {
	[PASS_CLOUD] = {.file = "shaders/passes/radiosity_cloud.glsl",
			.outputs = 3,
			.samplers = {"thickness_table", "slab_table", "transmittance_table"}},
	[PASS_GROUND] = {.file = "shaders/passes/radiosity_ground.glsl",
			 .outputs = 2,
			 .samplers = {"cloud_direct", "ground_map", "transmittance_table"}},
};

/* What the exchange starts from: pictures that the passes paint, and the solver's copies, bands one plane after the other. */
enum { CLOUD_SOURCE, CLOUD_ALBEDO, CLOUD_DIRECT, GROUND_ALBEDO, GROUND_DIRECT, PLANE_COUNT };

struct planes {
	int side;
	struct texture texture[PLANE_COUNT];
	float *texels, *values[PLANE_COUNT], *ground_received, *cloud_received; /* one block of memory */
};

struct result {
	struct texture ground_received, cloud_received;
	struct radiosity_solution solution;
};

bool radiosity_stage_init(struct radiosity_stage *stage, const struct pass_compiler *compiler)
{
	return stage_create_passes(compiler, pass_descs, stage->passes, RADIOSITY_PASS_COUNT);
}

void radiosity_stage_finish(struct radiosity_stage *stage)
{
	stage_destroy_passes(stage->passes, RADIOSITY_PASS_COUNT);
}

/* --- planes ---------------------------------------------------------------------------------------------------------------------- */

static void planes_finish(struct planes *planes)
{
	for (int i = 0; i < PLANE_COUNT; i++)
		texture_finish(&planes->texture[i]);
	free(planes->texels);
}

static bool planes_init(struct planes *planes, int side)
{
	const size_t texels = (size_t)side * (size_t)side, values = EXCHANGE_BANDS * texels;
	*planes = (struct planes){.side = side};
	planes->texels = malloc((4 * texels + (PLANE_COUNT + 2) * values) * sizeof *planes->texels);
	bool ok = planes->texels;
	for (int i = 0; ok && i < PLANE_COUNT; i++) {
		planes->values[i] = planes->texels + 4 * texels + (size_t)i * values;
		ok = texture_init(&planes->texture[i], side, side, TEXTURE_RGBA32F, TEXTURE_REPEAT);
	}
	if (!ok) {
		planes_finish(planes);
		return false;
	}
	planes->ground_received = planes->values[PLANE_COUNT - 1] + values;
	planes->cloud_received = planes->ground_received + values;
	return true;
}

static void paint_planes(const struct radiosity_stage *stage, struct planes *planes, const struct ground_maps *ground,
			 const struct sky_tables *sky, const struct field_maps *field, const struct texture *slab_rows)
{
	struct texture *all = planes->texture;
	pass_run(stage->passes[PASS_CLOUD],
		 &(struct pass_run){.targets = (struct texture *[]){&all[CLOUD_SOURCE], &all[CLOUD_ALBEDO], &all[CLOUD_DIRECT]},
				    .samplers = {field->thickness, slab_rows, sky->transmittance},
				    .arguments = {{(float)field->thickness->width / (float)planes->side}}});
	pass_run(stage->passes[PASS_GROUND], &(struct pass_run){.targets = (struct texture *[]){&all[GROUND_ALBEDO], &all[GROUND_DIRECT]},
								.samplers = {&all[CLOUD_DIRECT], ground->map, sky->transmittance},
								.arguments = {{(float)planes->side}}});
}

static void read_plane(struct planes *planes, int plane)
{
	const int texels = planes->side * planes->side;
	stage_read_texture(&planes->texture[plane], 0, 4, planes->texels);
	for (int band = 0; band < EXCHANGE_BANDS; band++)
		for (int i = 0; i < texels; i++)
			planes->values[plane][band * texels + i] = planes->texels[4 * i + band];
}

static bool upload_plane(struct planes *planes, const float *values, struct texture *texture)
{
	const int texels = planes->side * planes->side;
	if (!texture_init(texture, planes->side, planes->side, TEXTURE_RGBA32F, TEXTURE_REPEAT))
		return false;
	for (int i = 0; i < texels; i++) {
		for (int band = 0; band < EXCHANGE_BANDS; band++)
			planes->texels[4 * i + band] = values[band * texels + i];
		planes->texels[4 * i + 3] = 1;
	}
	texture_upload(texture, planes->texels);
	return true;
}

/* --- the result ------------------------------------------------------------------------------------------------------------------ */

static const float *kernel_get(struct stage_context *context, const struct scene_clouds *clouds, int side)
{
	struct cache_key key = cache_key_make("exchange");
	cache_key_add(&key, side);
	cache_key_add(&key, clouds->tile_m);
	cache_key_add(&key, clouds->base_m);
	float *kernel = cache_find(context->cache, &key);
	if (kernel)
		return kernel;
	kernel = exchange_kernel_create(side, clouds->tile_m, clouds->base_m);
	return kernel && cache_keep(context->cache, &key, kernel, (size_t)side * (size_t)side * sizeof *kernel, free) ? kernel : NULL;
}

static bool solve(struct planes *planes, const struct scene *scene, const struct scene_block *block, const float *kernel,
		  struct radiosity_solution *solution)
{
	struct exchange exchange;
	const double drift[] = {(double)block->cloud_drift[0] / scene->clouds.tile_m, (double)block->cloud_drift[1] / scene->clouds.tile_m};
	const struct radiosity_planes inputs = {.source = planes->values[CLOUD_SOURCE],
						.cloud_albedo = planes->values[CLOUD_ALBEDO],
						.ground_albedo = planes->values[GROUND_ALBEDO],
						.direct = planes->values[GROUND_DIRECT]};
	solution->ground_received = planes->ground_received;
	solution->cloud_received = planes->cloud_received;
	const bool ok = exchange_init(&exchange, planes->side, kernel, drift) &&
			radiosity_solve(&exchange, &inputs, scene->radiosity.tolerance,
					scene->radiosity.enabled ? scene->radiosity.max_passes : 0, solution);
	exchange_finish(&exchange);
	return ok;
}

static void result_destroy(void *value)
{
	struct result *result = value;
	if (!result)
		return;
	texture_finish(&result->cloud_received);
	texture_finish(&result->ground_received);
	free(result);
}

static struct result *result_compute(const struct radiosity_stage *stage, struct stage_context *context, const struct scene *scene,
				     const struct ground_maps *ground, const struct sky_tables *sky, const struct field_maps *field,
				     const struct texture *slab_rows)
{
	const int side = exchange_side(scene->clouds.tile_m, scene->clouds.base_m);
	const float *kernel = kernel_get(context, &scene->clouds, side);
	struct planes planes;
	struct result *result = calloc(1, sizeof *result);
	if (!kernel || !result || !planes_init(&planes, side)) {
		free(result);
		return NULL;
	}
	paint_planes(stage, &planes, ground, sky, field, slab_rows);
	const bool wanted = !stage_is_stopped(context);
	for (int i = 0; wanted && i < PLANE_COUNT; i++)
		if (i != CLOUD_DIRECT)
			read_plane(&planes, i);
	const bool ok = wanted && solve(&planes, scene, &context->block, kernel, &result->solution) &&
			upload_plane(&planes, planes.ground_received, &result->ground_received) &&
			upload_plane(&planes, planes.cloud_received, &result->cloud_received);
	planes_finish(&planes);
	if (!ok) {
		result_destroy(result);
		return NULL;
	}
	return result;
}

/* Air under the clouds keeps the share of a clear sky's light that the beam does on its way to the ground; a beam along the horizon is
 * taken for its share of all light. In place of the rest it is among cloud base and ground, whose light it scatters without preference:
 * mean radiance over the sphere, of the flux from above and from below. */
static void fill_air_below(struct scene_block *block, const struct radiosity_solution *result, const struct sky_tables *sky)
{
	const double mu = fmax(0, block->sun_direction[2]), grazing = fmax(0, 1 - mu / 0.1);
	for (int band = 0; band < 3; band++) {
		const double beam = sky->sun_ground[band] * mu, diffuse = sky->diffuse_ground[band];
		const double clear = beam + grazing * diffuse;
		const double clouded = result->ground_direct[band] + grazing * result->ground_diffuse[band];
		const double share = clear > 0 ? fmin(1, clouded / clear) : 1;
		const double albedo = block->ground_mean_albedo[band];
		const double around_clear = diffuse + albedo * (beam + diffuse);
		const double around = result->ground_diffuse[band] + albedo * (result->ground_direct[band] + result->ground_diffuse[band]);
		const double extinction = block->rayleigh[band] + block->aerosol[band];
		const double scattered = (block->rayleigh[band] + block->aerosol[band] * block->aerosol_shape[0]) / fmax(extinction, 1e-30);
		block->air_below[band] = (float)share;
		block->air_around[band] = (float)(fmax(0, around - share * around_clear) * scattered / (2 * M_PI));
	}
}

bool radiosity_stage_run(const struct radiosity_stage *stage, struct stage_context *context, const struct scene *scene,
			 const struct ground_maps *ground, const struct sky_tables *sky, const struct field_maps *field,
			 const struct texture *slab_rows, struct radiosity_light *light)
{
	struct cache_key key = cache_key_make("radiosity");
	stage_key_add_light(&key, scene);
	struct result *result = cache_find(context->cache, &key);
	if (!result) {
		context->reused = false;
		stage_upload_block(context);
		result = result_compute(stage, context, scene, ground, sky, field, slab_rows);
		if (!result || !cache_keep(context->cache, &key, result, 2 * texture_bytes(&result->ground_received), result_destroy)) {
			return stage_fails(context, "radiosity");
		}
	}
	const struct radiosity_solution *solution = &result->solution;
	fill_air_below(&context->block, solution, sky);
	*light = (struct radiosity_light){.ground_received = &result->ground_received,
					  .cloud_received = &result->cloud_received,
					  .passes = solution->passes,
					  .residual = solution->last_residual};
	memcpy(light->residuals, solution->residual, sizeof light->residuals);
	memcpy(light->ground_diffuse, solution->ground_diffuse, sizeof light->ground_diffuse);
	memcpy(light->ground_direct, solution->ground_direct, sizeof light->ground_direct);
	return true;
}
