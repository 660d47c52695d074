#include "renderer/stages/sea.h"

#include "renderer/log.h"

#include <math.h>
#include <stdlib.h>

const double sea_eye_m = 2;

/* As in shaders/lib/sea.glsl. */
enum { SKY_SIDE = 128 };

static const double gravity = 9.81;

void sea_stage_init(struct sea_stage *stage, const struct pass_compiler *compiler)
{
	stage->compiler = *compiler;
}

void sea_stage_finish(struct sea_stage *stage)
{
	struct pass **passes = &stage->passes[0][0][0][0];
	for (size_t i = 0; i < sizeof stage->passes / sizeof *passes; i++)
		pass_destroy(passes[i]);
	*stage = (struct sea_stage){0};
}

double sea_wind(const struct scene_clouds *clouds)
{
	return fmin(15, fmax(2, hypot(clouds->wind_mps[0], clouds->wind_mps[1])));
}

void sea_albedo(const struct scene *scene, double albedo[3])
{
	/* What leaves the water, pi times shaders/lib/sea.glsl's SEA_LEAVING, against the mean that the broad-band fits hold. */
	static const double leaving[3] = {0.0006, 0.0045, 0.0126}, leaving_mean = 0.005;
	const double mu = fmax(0.02, sin(scene->sun.elevation_deg * M_PI / 180));
	const double clear = scene_has_clouds(scene) ? 1 - scene->clouds.coverage : 1;
	const double beam = clear * (scene->sun.elevation_deg > 0 ? 0.95 * exp(-0.085 / mu) : 0);
	const double mirrored = beam * 0.037 / (1.1 * pow(mu, 1.4) + 0.15) + (1 - beam) * 0.06;
	for (int band = 0; band < 3; band++)
		albedo[band] = mirrored + leaving[band] - leaving_mean;
}

/* Evenly spread numbers in 0..1. */
static double spread(int i, double step)
{
	return i * step - floor(i * step);
}

void sea_fill_block(struct scene_block *block, const struct scene *scene)
{
	const double wind = sea_wind(&scene->clouds), *motion = scene->clouds.wind_mps;
	const double heading = hypot(motion[0], motion[1]) > 0 ? atan2(motion[1], motion[0]) : 0;
	/* Cox and Munk 1954, clean surface: variance of slopes along and across the wind. Whitecaps: Monahan and O'Muircheartaigh 1980. */
	const double along = 3.16e-3 * wind, across = 0.003 + 1.92e-3 * wind;
	const double c = cos(heading), s = sin(heading);
	block->sea_state[0] = (float)(along * c * c + across * s * s);
	block->sea_state[1] = (float)((along - across) * c * s);
	block->sea_state[2] = (float)(along * s * s + across * c * c);
	block->sea_state[3] = (float)(3.84e-6 * pow(wind, 3.41));

	/* From the peak of a full-grown sea (Pierson and Moskowitz 1964: 0.877 g / U) down to what hardly a pixel resolves. Slopes are even
	 * over the logarithm of length there (Phillips' saturation), 0.0055 of variance per factor of e; what is left of Cox and Munk's is
	 * ripples. */
	const double longest = 2 * M_PI * wind * wind / (0.877 * 0.877 * gravity), shortest = 0.09, octaves = log(longest / shortest);
	const double variance = fmin(0.0055 * octaves, 0.75 * (along + across)) / SEA_WAVES;
	for (int i = 0; i < SEA_WAVES; i++) {
		const double length = longest * exp(-octaves * (i + 0.8 * spread(i, 0.7548776662)) / SEA_WAVES);
		/* Long waves run with the wind, short ones to all sides of it. */
		const double within = (40 + 60.0 * i / SEA_WAVES) * M_PI / 180;
		const double direction = heading + within * (2 * spread(i + 1, 0.6180339887) - 1);
		const double k = 2 * M_PI / length, kx = k * cos(direction), ky = k * sin(direction);
		const double phase = kx * scene->camera.position_m[0] + ky * scene->camera.position_m[1] -
				     sqrt(gravity * k) * scene->clouds.time_s + 2 * M_PI * spread(i, 0.5698402910);
		block->sea_waves[i][0] = (float)kx;
		block->sea_waves[i][1] = (float)ky;
		block->sea_waves[i][2] = (float)fmod(phase, 2 * M_PI);
		block->sea_waves[i][3] = (float)sqrt(2 * variance);
	}
}

static struct cache_key make_key(const struct scene *scene)
{
	struct cache_key key = cache_key_make("sea");
	cache_key_add(&key, scene->camera.position_m[0]);
	cache_key_add(&key, scene->camera.position_m[1]);
	stage_key_add_light(&key, scene);
	return key;
}

static void texture_destroy(void *value)
{
	struct texture *texture = value;
	texture_finish(texture);
	free(texture);
}

static struct texture *sky_compute(const struct pass *pass, const struct pass_run *inputs)
{
	struct texture *sky = calloc(1, sizeof *sky);
	if (!sky || !texture_init(sky, SKY_SIDE, SKY_SIDE, TEXTURE_RGBA16F, TEXTURE_MIPMAPS)) {
		free(sky);
		return NULL;
	}
	struct pass_run run = *inputs;
	run.targets = &sky;
	pass_run(pass, &run);
	texture_build_mipmaps(sky);
	return sky;
}

const struct texture *sea_stage_run(struct sea_stage *stage, struct stage_context *context, const struct scene *scene,
				    const struct view_inputs *inputs)
{
	const struct cache_key key = make_key(scene);
	struct texture *sky = cache_find(context->cache, &key);
	if (sky)
		return sky;
	context->reused = false;
	const bool clouds = inputs->light;
	const struct view_variant variant = {.side = clouds ? VIEW_BELOW : VIEW_CLEAR,
					     .region = VIEW_SKY,
					     .shading = clouds ? scene->model.shading : SHADING_SOLVED,
					     .twilight = clouds && context->block.slab_light[1] > 0,
					     .packed = clouds && inputs->field->coarse_packed};
	struct pass **pass = &stage->passes[clouds][variant.shading][variant.twilight][variant.packed];
	if (!*pass && !(*pass = view_create_pass(&stage->compiler, "shaders/passes/sea_sky.glsl", 1, &variant)))
		return NULL;
	struct pass_run run = {0};
	view_bind_inputs(&run, variant.side, inputs);
	sky = sky_compute(*pass, &run);
	if (!sky || !cache_keep(context->cache, &key, sky, texture_bytes(sky), texture_destroy)) {
		log_error("sea: out of memory");
		return NULL;
	}
	return sky;
}
