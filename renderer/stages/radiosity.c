#include "renderer/stages/radiosity.h"

#include "renderer/log.h"
#include "renderer/stages/exchange_weights.h"

#include <math.h>
#include <stdlib.h>

enum { PASS_SOURCES, PASS_START, PASS_EXCHANGE, PASS_CLOSE, PASS_REDUCE };

static const struct pass_desc pass_descs[RADIOSITY_PASS_COUNT] = {
	[PASS_SOURCES] = {.file = "shaders/passes/radiosity_sources.glsl",
			  .outputs = 4,
			  .samplers = {"transmittance_table", "field_coarse", "field_detail", "slab_table", "ground_map"}},
	[PASS_START] = {.file = "shaders/passes/radiosity_start.glsl",
			.outputs = 4,
			.samplers = {"cloud_source", "ground_albedo_plane", "ground_direct"}},
	[PASS_EXCHANGE] = {.file = "shaders/passes/radiosity_exchange.glsl",
			   .outputs = 4,
			   .samplers = {"ground_received", "cloud_received", "ground_sends", "cloud_sends", "ground_albedo_plane",
					"cloud_albedo_plane"}},
	[PASS_CLOSE] = {.file = "shaders/passes/radiosity_close.glsl",
			.outputs = 2,
			.samplers = {"ground_received", "cloud_received", "ground_sends", "cloud_sends", "ground_albedo_plane",
				     "cloud_albedo_plane"}},
	[PASS_REDUCE] = {.file = "shaders/passes/radiosity_reduce.glsl", .outputs = 2, .samplers = {"first_below", "second_below"}},
};

/* The four moving planes exist twice, read from one set and written to the other. */
enum { GROUND_RECEIVED, CLOUD_RECEIVED, GROUND_SENDS, CLOUD_SENDS, PLANE_COUNT };

struct planes {
	struct texture source, cloud_albedo, ground_albedo, ground_direct;
	struct texture set[2][PLANE_COUNT];
};

struct result {
	struct texture ground_received, cloud_received;
	double ground_diffuse[3], ground_direct[3], residual;
	int passes;
};

void radiosity_build_levels(const struct pass *reduce, struct texture *first, struct texture *second)
{
	for (int level = 1; level < EXCHANGE_LEVELS; level++) {
		struct texture below[2] = {texture_level(first, level - 1), texture_level(second, level - 1)};
		pass_run(reduce, &(struct pass_run){.targets = (struct texture *[]){first, second},
						    .level = level,
						    .samplers = {&below[0], &below[1]},
						    .arguments = {{(float)(EXCHANGE_SIDE >> (level - 1))}}});
		texture_finish(&below[0]);
		texture_finish(&below[1]);
	}
}

bool radiosity_stage_init(struct radiosity_stage *stage, const struct pass_compiler *compiler)
{
	return stage_create_passes(compiler, pass_descs, stage->passes, RADIOSITY_PASS_COUNT);
}

void radiosity_stage_finish(struct radiosity_stage *stage)
{
	stage_destroy_passes(stage->passes, RADIOSITY_PASS_COUNT);
}

static void planes_finish(struct planes *planes)
{
	struct texture *all[] = {&planes->source, &planes->cloud_albedo, &planes->ground_albedo, &planes->ground_direct};
	for (int i = 0; i < 4; i++)
		texture_finish(all[i]);
	for (int i = 0; i < 2 * PLANE_COUNT; i++)
		texture_finish(&planes->set[i / PLANE_COUNT][i % PLANE_COUNT]);
}

static bool plane_init(struct texture *texture)
{
	return texture_init(texture, EXCHANGE_SIDE, EXCHANGE_SIDE, TEXTURE_RGBA32F, TEXTURE_REPEAT | TEXTURE_MIPMAPS);
}

static bool planes_init(struct planes *planes)
{
	*planes = (struct planes){0};
	struct texture *all[] = {&planes->source, &planes->cloud_albedo, &planes->ground_albedo, &planes->ground_direct};
	bool ok = true;
	for (int i = 0; ok && i < 4; i++)
		ok = plane_init(all[i]);
	for (int i = 0; ok && i < 2 * PLANE_COUNT; i++)
		ok = plane_init(&planes->set[i / PLANE_COUNT][i % PLANE_COUNT]);
	if (!ok)
		planes_finish(planes);
	return ok;
}

static void fill_weights(float arguments[PASS_ARGUMENTS][4], const struct scene_clouds *clouds)
{
	double weights[EXCHANGE_LEVELS];
	exchange_weights(clouds->tile_m, clouds->base_m, weights);
	for (int i = 0; i < EXCHANGE_LEVELS; i++)
		arguments[i / 4][i % 4] = (float)weights[i];
	int first = 0, last = EXCHANGE_LEVELS - 1;
	while (first < last && weights[first] == 0)
		first++;
	while (last > first && weights[last] == 0)
		last--;
	arguments[2][0] = (float)first;
	arguments[2][1] = (float)last;
}

static void run_sources(const struct radiosity_stage *stage, struct planes *planes, const struct ground_maps *ground,
			const struct sky_tables *sky, const struct field_maps *field, const struct texture *slab_rows)
{
	struct texture *targets[] = {&planes->source, &planes->cloud_albedo, &planes->ground_albedo, &planes->ground_direct};
	pass_run(stage->passes[PASS_SOURCES],
		 &(struct pass_run){.targets = targets,
				    .samplers = {sky->transmittance, field->coarse, field->detail, slab_rows, ground->map}});
	/* The source is spread out by its levels; of the others only the means are asked for. */
	radiosity_build_levels(stage->passes[PASS_REDUCE], &planes->source, &planes->cloud_albedo);
	texture_build_mipmaps(&planes->ground_albedo);
	texture_build_mipmaps(&planes->ground_direct);
}

static void run_exchange(const struct radiosity_stage *stage, struct planes *planes, int kind, int from, const struct pass_run *weights)
{
	const struct texture *set = planes->set[from];
	struct texture *targets[PLANE_COUNT];
	for (int i = 0; i < PLANE_COUNT; i++)
		targets[i] = &planes->set[!from][i];
	struct pass_run run = *weights;
	run.targets = targets;
	for (int i = 0; i < PLANE_COUNT; i++)
		run.samplers[i] = &set[i];
	run.samplers[PLANE_COUNT] = &planes->ground_albedo;
	run.samplers[PLANE_COUNT + 1] = &planes->cloud_albedo;
	pass_run(stage->passes[kind], &run);
	/* Closing makes no further light to send; the ground's mean is always asked for. */
	texture_build_mipmaps(targets[GROUND_RECEIVED]);
	if (kind != PASS_CLOSE)
		radiosity_build_levels(stage->passes[PASS_REDUCE], targets[GROUND_SENDS], targets[CLOUD_SENDS]);
}

static void mean_of(const struct texture *plane, double mean[3])
{
	float texel[4];
	stage_read_texture(plane, EXCHANGE_LEVELS - 1, 4, texel);
	for (int band = 0; band < 3; band++)
		mean[band] = texel[band];
}

/* What is still on its way, relative to what the ground has: the largest band. */
static double residual_of(const struct planes *planes, int set, const double received[3])
{
	double ground[3], cloud[3], largest = 0;
	mean_of(&planes->set[set][GROUND_SENDS], ground);
	mean_of(&planes->set[set][CLOUD_SENDS], cloud);
	for (int band = 0; band < 3; band++)
		largest = fmax(largest, (ground[band] + cloud[band]) / fmax(received[band], 1e-12));
	return largest;
}

static void compute(const struct radiosity_stage *stage, struct planes *planes, const struct scene *scene, struct result *result)
{
	struct pass_run weights = {0};
	fill_weights(weights.arguments, &scene->clouds);

	struct pass_run start = weights;
	struct texture *targets[PLANE_COUNT];
	for (int i = 0; i < PLANE_COUNT; i++)
		targets[i] = &planes->set[0][i];
	start.targets = targets;
	start.samplers[0] = &planes->source;
	start.samplers[1] = &planes->ground_albedo;
	start.samplers[2] = &planes->ground_direct;
	pass_run(stage->passes[PASS_START], &start);
	texture_build_mipmaps(targets[GROUND_RECEIVED]);
	radiosity_build_levels(stage->passes[PASS_REDUCE], targets[GROUND_SENDS], targets[CLOUD_SENDS]);

	int at = 0;
	const int most = scene->radiosity.enabled ? scene->radiosity.max_passes : 0;
	while (result->passes < most) {
		run_exchange(stage, planes, PASS_EXCHANGE, at, &weights);
		at = !at;
		result->passes++;
		mean_of(&planes->set[at][GROUND_RECEIVED], result->ground_diffuse);
		result->residual = residual_of(planes, at, result->ground_diffuse);
		if (result->residual <= scene->radiosity.tolerance)
			break;
	}
	if (result->passes > 0) {
		run_exchange(stage, planes, PASS_CLOSE, at, &weights);
		at = !at;
	}
	mean_of(&planes->set[at][GROUND_RECEIVED], result->ground_diffuse);
	mean_of(&planes->ground_direct, result->ground_direct);

	/* The two planes that the view needs move out of the set, whose rest is freed. */
	result->ground_received = planes->set[at][GROUND_RECEIVED];
	result->cloud_received = planes->set[at][CLOUD_RECEIVED];
	planes->set[at][GROUND_RECEIVED] = planes->set[at][CLOUD_RECEIVED] = (struct texture){0};
}

static void result_destroy(void *value)
{
	struct result *result = value;
	texture_finish(&result->cloud_received);
	texture_finish(&result->ground_received);
	free(result);
}

static struct result *result_compute(const struct radiosity_stage *stage, const struct scene *scene, const struct ground_maps *ground,
				     const struct sky_tables *sky, const struct field_maps *field, const struct texture *slab_rows)
{
	struct planes planes;
	struct result *result = calloc(1, sizeof *result);
	if (!result || !planes_init(&planes)) {
		free(result);
		return NULL;
	}
	run_sources(stage, &planes, ground, sky, field, slab_rows);
	compute(stage, &planes, scene, result);
	planes_finish(&planes);
	return result;
}

/* Air under the clouds keeps the share of a clear sky's light that the beam does on its way to the ground; a beam along the horizon is
 * taken for its share of all light. In place of the rest it is among cloud base and ground, whose light it scatters without preference:
 * mean radiance over the sphere, of the flux from above and from below. */
static void fill_air_below(struct scene_block *block, const struct result *result, const struct sky_tables *sky)
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
		result = result_compute(stage, scene, ground, sky, field, slab_rows);
		if (!result || !cache_keep(context->cache, &key, result, 2 * texture_bytes(&result->ground_received), result_destroy)) {
			log_error("radiosity: out of memory");
			return false;
		}
	}
	fill_air_below(&context->block, result, sky);
	*light = (struct radiosity_light){.ground_received = &result->ground_received,
					  .cloud_received = &result->cloud_received,
					  .passes = result->passes,
					  .residual = result->residual};
	for (int band = 0; band < 3; band++) {
		light->ground_diffuse[band] = result->ground_diffuse[band];
		light->ground_direct[band] = result->ground_direct[band];
	}
	return true;
}
