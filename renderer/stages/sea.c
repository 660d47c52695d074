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

/* Waves are cut off here: longer ones hold 1 % of the variance, shorter ones are ripples that hardly a pixel resolves. */
static const double longest_over_peak = 1.7, shortest_m = 0.06;

/* Elfouhaily, Chapron, Katsaros and Vandemark 1997 (J. Geophys. Res. 102, 15781), of a full-grown sea: an inverse wave age of 0.84. */
static const double wave_age = 0.84, ripple_k = 370, ripple_speed = 0.23;

struct spectrum {
	double peak_k, peak_speed, friction; /* 1/m; m/s; friction velocity of the air, m/s */
};

/* Phase speed on deep water, capillarity included, m/s. */
static double wave_speed(double k)
{
	return sqrt(gravity / k * (1 + k * k / (ripple_k * ripple_k)));
}

static struct spectrum spectrum_of(double wind)
{
	const double k = gravity * wave_age * wave_age / (wind * wind);
	/* Drag of the sea: Wu 1982 (J. Geophys. Res. 87, 9704). */
	return (struct spectrum){.peak_k = k, .peak_speed = wave_speed(k), .friction = wind * sqrt((0.8 + 0.065 * wind) * 1e-3)};
}

/* Variance of slopes per unit of log k: their equations 30 to 34 for long waves, 40, 41 and 44 for short ones. */
static double spectrum_slopes(const struct spectrum *s, double k)
{
	const double c = wave_speed(k), ratio = k / s->peak_k, width = 0.08 * (1 + 4 / pow(wave_age, 3));
	const double cut = exp(-1.25 / (ratio * ratio)), off = sqrt(ratio) - 1;
	const double peak = cut * pow(1.7, exp(-off * off / (2 * width * width)));
	const double of_long = 0.5 * 6e-3 * pow(wave_age, 0.55) * s->peak_speed / c * exp(-wave_age / sqrt(10) * off);
	const double excess = log(s->friction / ripple_speed), near_ripples = k / ripple_k - 1;
	const double of_short =
		0.5 * 1e-2 * fmax(0, 1 + (excess > 0 ? 3 : 1) * excess) * ripple_speed / c * exp(-0.25 * near_ripples * near_ripples);
	return peak * (of_long + of_short);
}

/* How much waves keep to the wind: their density over the angle to it is 1 + this times cos(2 angle); equation 57. */
static double spectrum_spread(const struct spectrum *s, double k)
{
	const double c = wave_speed(k);
	return tanh(0.25 * M_LN2 + 4 * pow(c / s->peak_speed, 2.5) + 0.13 * s->friction / ripple_speed * pow(ripple_speed / c, 2.5));
}

/* The angle below which a share of that density lies, within a right angle of the wind: none run against it. */
static double angle_of_share(double share, double spread_by_wind)
{
	double low = -M_PI / 2, high = M_PI / 2;
	for (int i = 0; i < 30; i++) {
		const double middle = 0.5 * (low + high);
		const double below = 0.5 + middle / M_PI + spread_by_wind * sin(2 * middle) / (2 * M_PI);
		*(below < share ? &low : &high) = middle;
	}
	return low;
}

/* One wave of each of SEA_WAVES bands, with what the band holds of the spectrum. Bands are narrower among the long waves: those are all
 * that is seen from high up, where few would be counted. */
static void fill_waves(struct scene_block *block, const struct scene *scene, double wind, double heading)
{
	const struct spectrum spectrum = spectrum_of(wind);
	const double first = spectrum.peak_k / longest_over_peak, octaves = log(2 * M_PI / shortest_m / first);
	for (int i = 0; i < SEA_WAVES; i++) {
		const double begin = octaves * pow((double)i / SEA_WAVES, 1.5), band = octaves * pow((i + 1.0) / SEA_WAVES, 1.5) - begin;
		const double k = first * exp(begin + band * spread(i, 0.7548776662));
		/* Taken out of a density of half the spread, and weighted for that: slopes across the wind would be those of few waves
		 * else. */
		const double spread_by_wind = spectrum_spread(&spectrum, k);
		const double angle = angle_of_share(spread(i + 1, 0.6180339887), 0.5 * spread_by_wind),
			     both = spread_by_wind * cos(2 * angle);
		const double weight = (1 + both) / (1 + 0.5 * both), direction = heading + angle;
		const double kx = k * cos(direction), ky = k * sin(direction);
		const double phase = kx * scene->camera.position_m[0] + ky * scene->camera.position_m[1] -
				     k * wave_speed(k) * scene->clouds.time_s + 2 * M_PI * spread(i, 0.5698402910);
		const double turns = phase / (2 * M_PI), slope = sqrt(2 * weight * band * spectrum_slopes(&spectrum, k));
		block->sea_waves[i][0] = (float)(kx / (2 * M_PI));
		block->sea_waves[i][1] = (float)(ky / (2 * M_PI));
		block->sea_waves[i][2] = (float)(turns - floor(turns));
		block->sea_waves[i][3] = (float)(slope * 2 * M_PI / k);
	}
}

/* In light winds the spectrum has more slope than Cox and Munk saw, whose photographs decide: a share of theirs is left to ripples. */
static void limit_waves(struct scene_block *block, double along, double across, double heading)
{
	double held[2] = {0, 0};
	for (int i = 0; i < SEA_WAVES; i++) {
		const float *wave = block->sea_waves[i];
		const double with = wave[0] * cos(heading) + wave[1] * sin(heading),
			     aside = wave[1] * cos(heading) - wave[0] * sin(heading);
		held[0] += 0.5 * pow(with * wave[3], 2);
		held[1] += 0.5 * pow(aside * wave[3], 2);
	}
	const double scale = sqrt(fmin(1, 0.75 * fmin(along / held[0], across / held[1])));
	for (int i = 0; i < SEA_WAVES; i++)
		block->sea_waves[i][3] *= (float)scale;
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
	fill_waves(block, scene, wind, heading);
	limit_waves(block, along, across, heading);
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
