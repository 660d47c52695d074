#include "renderer/stages/sky.h"

#include "renderer/log.h"
#include "renderer/stages/colour.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PASS_TRANSMITTANCE, PASS_MULTISCATTER, PASS_MULTISCATTER_AGAIN, PASS_GROUND, PASS_VIEW, PASS_IRRADIANCE, PASS_RAYS };

#define AIR_SAMPLERS                                                                                                                       \
	"transmittance_table", "diffuse_0", "diffuse_1", "diffuse_2", "diffuse_3", "diffuse_4", "diffuse_5", "diffuse_6", "diffuse_7"
enum { MOMENT_COUNT = 8 };

static const struct pass_desc pass_descs[SKY_PASS_COUNT] = {
	[PASS_TRANSMITTANCE] = {.file = "shaders/passes/transmittance.glsl", .outputs = 1},
	[PASS_MULTISCATTER] = {.file = "shaders/passes/multiscatter.glsl",
			       .defines = "#define MULTISCATTER_AGAIN 0\n#define MULTISCATTER_GROUND 0\n",
			       .outputs = MOMENT_COUNT,
			       .samplers = {"transmittance_table"}},
	[PASS_MULTISCATTER_AGAIN] = {.file = "shaders/passes/multiscatter.glsl",
				     .defines = "#define MULTISCATTER_AGAIN 1\n#define MULTISCATTER_GROUND 0\n",
				     .outputs = MOMENT_COUNT,
				     .samplers = {AIR_SAMPLERS, "ground_irradiance"}},
	[PASS_GROUND] = {.file = "shaders/passes/multiscatter.glsl",
			 .defines = "#define MULTISCATTER_AGAIN 1\n#define MULTISCATTER_GROUND 1\n",
			 .outputs = 1,
			 .samplers = {AIR_SAMPLERS}},
	[PASS_VIEW] = {.file = "shaders/passes/sky_view.glsl", .outputs = 4, .samplers = {AIR_SAMPLERS}},
	[PASS_IRRADIANCE] = {.file = "shaders/passes/sky_irradiance_rays.glsl", .outputs = 1, .samplers = {AIR_SAMPLERS}},
	[PASS_RAYS] = {.file = "shaders/passes/sky_rays.glsl", .outputs = 1, .samplers = {AIR_SAMPLERS, "ray_table"}},
};

/* Sizes as in shaders/lib/atmosphere.glsl, multiscatter.glsl, sky_table.glsl and passes/sky_irradiance_rays.glsl. */
enum { TRANSMITTANCE_W = 256, TRANSMITTANCE_H = 64, MULTISCATTER_W = 40, MULTISCATTER_H = 16, VIEW_W = 96, VIEW_H = 160, RAYS_SIDE = 16 };

/* Pairs of orders of scattering that are added to the closed series. */
enum { GATHERINGS = 1 };

/* Rayleigh optical thickness of the whole air at 650, 550, 450 nm (Bodhaine et al. 1999, sea level). Scale heights below and above 10 km
 * keep within 15 % of the density of the US Standard Atmosphere 1976 up to 50 km; the one of 8 km that is often taken has twice the air at
 * 40 to 50 km, and twice the light of civil twilight. */
static const double rayleigh_thickness[3] = {0.04714702, 0.09297450, 0.21150562};
static const double rayleigh_scale_m = 9200, rayleigh_bend_m = 10000, rayleigh_scale_above_m = 6500;
/* Aerosol as in the clear-sky comparison of Bruneton 2016 ("A Qualitative and Quantitative Evaluation of 8 Clear Sky Models"): optical
 * depth falling with wavelength^0.8, scale height 1.2 km, single scattering albedo 0.8, Cornette-Shanks asymmetry 0.7. */
static const double aerosol_exponent = 0.8, aerosol_scale_m = 1200, aerosol_albedo = 0.8, aerosol_asymmetry = 0.7;
/* Ozone absorption cross sections in m2 (Serdyuchenko et al. 2014, 223 K, means over 10 nm). The bands' own wavelengths miss the peak of
 * Chappuis' band at 600 nm, of which the red third of the spectrum has most: pictures take what gives sun, sky and twilight the colour and
 * luminance that a spectrum of 10 nm steps gives them (docs/validation/sky.md), numbers at 650, 550 and 450 nm what holds there. */
const double sky_ozone_of_pictures[3] = {4.4e-25, 3.3e-25, 3.5e-26};
const double sky_ozone_at_wavelength[3] = {2.4e-25, 3.3e-25, 1.7e-26};
/* 1 DU is 2.6867e20 molecules per m2; tent from 10 to 40 km, whose integral is its half-width of 15 km. */
static const double ozone_peak_m = 25000, ozone_half_width_m = 15000, dobson_per_m2 = 2.6867e20;

/* Angular radius of the sun, 0.533 degrees across. */
static const double sun_radius = 0.5 * 0.533 * M_PI / 180;

bool sky_stage_init(struct sky_stage *stage, const struct pass_compiler *compiler)
{
	return stage_create_passes(compiler, pass_descs, stage->passes, SKY_PASS_COUNT);
}

void sky_stage_finish(struct sky_stage *stage)
{
	stage_destroy_passes(stage->passes, SKY_PASS_COUNT);
}

/* Length that the coefficient at the ground stands for. */
static double rayleigh_column_m(void)
{
	const double left = exp(-rayleigh_bend_m / rayleigh_scale_m);
	return rayleigh_scale_m * (1 - left) + rayleigh_scale_above_m * left;
}

static void fill_block(struct scene_block *block, const struct scene *scene, const double mean_albedo[3], const double ozone[3])
{
	const double elevation = scene->sun.elevation_deg * M_PI / 180, azimuth = scene->sun.azimuth_deg * M_PI / 180;
	block->sun_direction[0] = (float)(cos(elevation) * sin(azimuth));
	block->sun_direction[1] = (float)(cos(elevation) * cos(azimuth));
	block->sun_direction[2] = (float)sin(elevation);
	block->sun_direction[3] = (float)sun_radius;
	for (int band = 0; band < 3; band++) {
		const double wavelength_um = (650 - 100 * band) * 1e-3;
		block->solar_irradiance[band] = (float)colour_solar_irradiance[band];
		block->rayleigh[band] = (float)(rayleigh_thickness[band] / rayleigh_column_m());
		block->aerosol[band] =
			(float)(scene->atmosphere.aerosol_optical_depth * pow(wavelength_um / 0.55, -aerosol_exponent) / aerosol_scale_m);
		block->ozone[band] = (float)(scene->atmosphere.ozone_du * dobson_per_m2 * ozone[band] / ozone_half_width_m);
		block->ground_mean_albedo[band] = (float)mean_albedo[band];
	}
	block->rayleigh[3] = (float)rayleigh_scale_m;
	block->aerosol[3] = (float)aerosol_scale_m;
	block->aerosol_shape[0] = (float)aerosol_albedo;
	block->aerosol_shape[1] = (float)aerosol_asymmetry;
	block->ozone[3] = (float)ozone_peak_m;
}

/* --- results -------------------------------------------------------------------------------------------------------------------- */

struct air_tables {
	struct texture transmittance, moments[MOMENT_COUNT]; /* shaders/lib/multiscatter.glsl */
};

static void moments_finish(struct texture moments[MOMENT_COUNT])
{
	for (int i = 0; i < MOMENT_COUNT; i++)
		texture_finish(&moments[i]);
}

static bool moments_init(struct texture moments[MOMENT_COUNT])
{
	for (int i = 0; i < MOMENT_COUNT; i++)
		if (!texture_init(&moments[i], MULTISCATTER_W, MULTISCATTER_H, TEXTURE_RGBA32F, 0))
			return false;
	return true;
}

static void air_tables_destroy(void *value)
{
	struct air_tables *air = value;
	moments_finish(air->moments);
	texture_finish(&air->transmittance);
	free(air);
}

/* In the order of AIR_SAMPLERS. */
static struct pass_run run_with_air(const struct texture *transmittance, const struct texture moments[MOMENT_COUNT])
{
	struct pass_run run = {.samplers = {transmittance}};
	for (int i = 0; i < MOMENT_COUNT; i++)
		run.samplers[1 + i] = &moments[i];
	return run;
}

static void gather(const struct pass *pass, struct pass_run run, struct texture moments[MOMENT_COUNT])
{
	struct texture *targets[MOMENT_COUNT];
	for (int i = 0; i < MOMENT_COUNT; i++)
		targets[i] = &moments[i];
	run.targets = targets;
	pass_run(pass, &run);
}

/* Adds an order of scattering: `from` to `to`, by way of the light on the ground. */
static void gather_again(const struct sky_stage *stage, const struct texture *transmittance, struct texture *ground,
			 const struct texture from[MOMENT_COUNT], struct texture to[MOMENT_COUNT])
{
	struct pass_run run = run_with_air(transmittance, from);
	run.targets = &ground;
	pass_run(stage->passes[PASS_GROUND], &run);
	run.samplers[1 + MOMENT_COUNT] = ground;
	gather(stage->passes[PASS_MULTISCATTER_AGAIN], run, to);
}

static bool compute_moments(const struct sky_stage *stage, struct stage_context *context, struct air_tables *air)
{
	struct texture before[MOMENT_COUNT] = {{0}}, ground = {0};
	bool ok = moments_init(air->moments) && moments_init(before) && texture_init(&ground, MULTISCATTER_W, 1, TEXTURE_RGBA32F, 0);
	if (ok)
		gather(stage->passes[PASS_MULTISCATTER], (struct pass_run){.samplers = {&air->transmittance}}, air->moments);
	for (int i = 0; ok && i < GATHERINGS; i++) {
		gather_again(stage, &air->transmittance, &ground, air->moments, before);
		gather_again(stage, &air->transmittance, &ground, before, air->moments);
		ok = !stage_is_stopped(context);
	}
	texture_finish(&ground);
	moments_finish(before);
	return ok;
}

static struct air_tables *air_tables_compute(const struct sky_stage *stage, struct stage_context *context)
{
	struct air_tables *air = calloc(1, sizeof *air);
	if (!air)
		return NULL;
	if (!texture_init(&air->transmittance, TRANSMITTANCE_W, TRANSMITTANCE_H, TEXTURE_RGBA32F, 0)) {
		air_tables_destroy(air);
		return NULL;
	}
	pass_run(stage->passes[PASS_TRANSMITTANCE], &(struct pass_run){.targets = (struct texture *[]){&air->transmittance}});
	if (!compute_moments(stage, context, air)) {
		air_tables_destroy(air);
		return NULL;
	}
	return air;
}

static const struct air_tables *air_tables_get(const struct sky_stage *stage, struct stage_context *context, const struct scene *scene,
					       const double mean_albedo[3])
{
	struct cache_key key = cache_key_make("air");
	cache_key_add(&key, scene->atmosphere.aerosol_optical_depth);
	/* Which cross sections: by the coefficients that came of them. */
	for (int band = 0; band < 3; band++) {
		cache_key_add(&key, context->block.ozone[band]);
		cache_key_add(&key, mean_albedo[band]);
	}
	struct air_tables *air = cache_find(context->cache, &key);
	if (air)
		return air;
	context->reused = false;
	air = air_tables_compute(stage, context);
	if (!air || !cache_keep(context->cache, &key, air,
				texture_bytes(&air->transmittance) + MOMENT_COUNT * texture_bytes(&air->moments[0]), air_tables_destroy))
		return NULL;
	return air;
}

struct sky_view {
	struct texture tables[4];
	double diffuse_cloud[3], diffuse_ground[3], sun_cloud[3], sun_ground[3], sun_camera[3];
};

static void sky_view_destroy(void *value)
{
	struct sky_view *view = value;
	for (int i = 0; i < 4; i++)
		texture_finish(&view->tables[i]);
	free(view);
}

/* Irradiance on a horizontal plane at a height. */
static bool diffuse_irradiance(const struct sky_stage *stage, const struct air_tables *air, double height, double irradiance[3])
{
	float texels[RAYS_SIDE * RAYS_SIDE][4];
	struct texture rays;
	if (!texture_init(&rays, RAYS_SIDE, RAYS_SIDE, TEXTURE_RGBA32F, TEXTURE_NEAREST))
		return false;
	struct pass_run run = run_with_air(&air->transmittance, air->moments);
	run.targets = (struct texture *[]){&rays};
	run.arguments[0][0] = (float)height;
	pass_run(stage->passes[PASS_IRRADIANCE], &run);
	stage_read_texture(&rays, 0, 4, &texels[0][0]);
	texture_finish(&rays);
	for (int band = 0; band < 3; band++) {
		irradiance[band] = 0;
		for (int i = 0; i < RAYS_SIDE * RAYS_SIDE; i++)
			irradiance[band] += texels[i][band] / (RAYS_SIDE * RAYS_SIDE);
	}
	return true;
}

/* Irradiance by the sun at a height, on a plane normal to the beam: the same air as the passes see, integrated here along one ray. */
static void sun_irradiance(const struct scene_block *block, double height, double irradiance[3])
{
	enum { STEPS = 2000 };
	const double radius = 6371000.0, top = 100000.0, mu = block->sun_direction[2], r = radius + height;
	const double horizon = -sqrt(height * (2 * radius + height)) / r;
	const double unit = fmin(1, fmax(0, (mu - horizon + sun_radius) / (2 * sun_radius)));
	const double visible = unit * unit * (3 - 2 * unit), cosine = fmax(mu, horizon);
	const double end = -r * cosine + sqrt(r * r * cosine * cosine + (top - height) * (2 * radius + top + height));
	double depth[3] = {0};
	for (int i = 0; i < STEPS; i++) {
		const double t = (i + 0.5) * end / STEPS, h = fmax(0, sqrt(r * r + 2 * r * cosine * t + t * t) - radius);
		for (int band = 0; band < 3; band++)
			depth[band] += end / STEPS *
				       (block->rayleigh[band] * exp(-fmin(h, rayleigh_bend_m) / rayleigh_scale_m -
								    fmax(h - rayleigh_bend_m, 0) / rayleigh_scale_above_m) +
					block->aerosol[band] * exp(-h / aerosol_scale_m) +
					block->ozone[band] * fmax(0, 1 - fabs(h - ozone_peak_m) / ozone_half_width_m));
	}
	for (int band = 0; band < 3; band++)
		irradiance[band] = visible * block->solar_irradiance[band] * exp(-depth[band]);
}

static struct sky_view *sky_view_compute(const struct sky_stage *stage, struct stage_context *context, const struct air_tables *air,
					 double cloud_height, double camera_height)
{
	struct sky_view *view = calloc(1, sizeof *view);
	if (!view)
		return NULL;
	struct texture *targets[4];
	for (int i = 0; i < 4; i++) {
		targets[i] = &view->tables[i];
		if (!texture_init(targets[i], VIEW_W, VIEW_H, TEXTURE_RGBA32F, 0))
			goto fail;
	}
	struct pass_run run = run_with_air(&air->transmittance, air->moments);
	run.targets = targets;
	pass_run(stage->passes[PASS_VIEW], &run);
	if (stage_is_stopped(context) || !diffuse_irradiance(stage, air, cloud_height, view->diffuse_cloud) ||
	    !diffuse_irradiance(stage, air, 0, view->diffuse_ground))
		goto fail;
	sun_irradiance(&context->block, cloud_height, view->sun_cloud);
	sun_irradiance(&context->block, 0, view->sun_ground);
	sun_irradiance(&context->block, camera_height, view->sun_camera);
	return view;

fail:
	sky_view_destroy(view);
	return NULL;
}

static const struct sky_view *sky_view_get(const struct sky_stage *stage, struct stage_context *context, const struct scene *scene,
					   const double mean_albedo[3], const struct air_tables *air)
{
	const bool clouds = scene->clouds.type != CLOUD_NONE;
	const double inputs[] = {scene->sun.elevation_deg,
				 scene->atmosphere.aerosol_optical_depth,
				 scene->atmosphere.ozone_du,
				 mean_albedo[0],
				 mean_albedo[1],
				 mean_albedo[2],
				 scene->camera.position_m[2],
				 clouds,
				 clouds ? scene->clouds.base_m : 0,
				 clouds ? scene->clouds.thickness_m : 0};
	struct cache_key key = cache_key_make("sky");
	for (size_t i = 0; i < sizeof inputs / sizeof *inputs; i++)
		cache_key_add(&key, inputs[i]);
	struct sky_view *view = cache_find(context->cache, &key);
	if (view)
		return view;
	context->reused = false;
	view = sky_view_compute(stage, context, air, clouds ? scene->clouds.base_m + scene->clouds.thickness_m : 0,
				scene->camera.position_m[2]);
	if (!view || !cache_keep(context->cache, &key, view, 4 * texture_bytes(&view->tables[0]), sky_view_destroy))
		return NULL;
	return view;
}

bool sky_stage_run(const struct sky_stage *stage, struct stage_context *context, const struct scene *scene, const double mean_albedo[3],
		   struct sky_tables *tables)
{
	fill_block(&context->block, scene, mean_albedo, sky_ozone_of_pictures);
	stage_upload_block(context);
	const struct air_tables *air = air_tables_get(stage, context, scene, mean_albedo);
	const struct sky_view *view = air ? sky_view_get(stage, context, scene, mean_albedo, air) : NULL;
	if (!view)
		return stage_fails(context, "sky");
	*tables = (struct sky_tables){.transmittance = &air->transmittance,
				      .total = &view->tables[0],
				      .near = &view->tables[1],
				      .to_layer = &view->tables[2],
				      .to_end = &view->tables[3]};
	memcpy(tables->diffuse_cloud, view->diffuse_cloud, sizeof view->diffuse_cloud);
	memcpy(tables->diffuse_ground, view->diffuse_ground, sizeof view->diffuse_ground);
	memcpy(tables->sun_cloud, view->sun_cloud, sizeof view->sun_cloud);
	memcpy(tables->sun_ground, view->sun_ground, sizeof view->sun_ground);
	for (int band = 0; band < 3; band++) {
		context->block.sky_irradiance_cloud[band] = (float)view->diffuse_cloud[band];
		context->block.sun_at_camera[band] = (float)view->sun_camera[band];
		context->block.sky_irradiance_ground[band] = (float)view->diffuse_ground[band];
	}
	return true;
}

/* --- single directions ------------------------------------------------------------------------------------------------------------ */

/* Rows over the zenith angles, columns over the azimuths. */
static bool rays_init(struct texture *rays, const struct scene_block *block, const struct sky_directions *directions)
{
	const int columns = directions->azimuth_count, rows = directions->view_count;
	float *texels = malloc((size_t)columns * (size_t)rows * 4 * sizeof *texels), *texel = texels;
	if (!texels || !texture_init(rays, columns, rows, TEXTURE_RGBA32F, TEXTURE_NEAREST)) {
		free(texels);
		return false;
	}
	for (int row = 0; row < rows; row++)
		for (int column = 0; column < columns; column++, texel += 4) {
			const double zenith = directions->view_zenith_deg[row] * M_PI / 180;
			const double azimuth = directions->azimuth_deg[column] * M_PI / 180;
			const double mu = fmax(0, cos(zenith));
			texel[0] = (float)mu;
			texel[1] = (float)(sin(zenith) * (sin(azimuth) * block->sun_direction[0] + cos(azimuth) * block->sun_direction[1]) +
					   mu * block->sun_direction[2]);
			texel[2] = texel[3] = 0;
		}
	texture_upload(rays, texels);
	free(texels);
	return true;
}

static bool radiance_along(const struct sky_stage *stage, const struct stage_context *context, const struct air_tables *air,
			   const struct sky_directions *directions, double *radiance)
{
	const int columns = directions->azimuth_count, rows = directions->view_count, count = columns * rows;
	struct texture rays = {0}, seen = {0};
	float *texels = malloc((size_t)count * 4 * sizeof *texels);
	const bool ok = texels && rays_init(&rays, &context->block, directions) &&
			texture_init(&seen, columns, rows, TEXTURE_RGBA32F, TEXTURE_NEAREST);
	if (ok) {
		struct pass_run run = run_with_air(&air->transmittance, air->moments);
		run.targets = (struct texture *[]){&seen};
		run.samplers[1 + MOMENT_COUNT] = &rays;
		pass_run(stage->passes[PASS_RAYS], &run);
		stage_read_texture(&seen, 0, 4, texels);
		for (int band = 0; band < 3; band++)
			for (int i = 0; i < count; i++)
				radiance[band * count + i] = texels[4 * i + band] / colour_solar_irradiance[band];
	}
	texture_finish(&seen);
	texture_finish(&rays);
	free(texels);
	return ok;
}

bool sky_stage_run_directions(const struct sky_stage *stage, struct stage_context *context, const struct scene *scene,
			      const double mean_albedo[3], const struct sky_directions *directions, struct sky_light *light)
{
	double sun[3];
	fill_block(&context->block, scene, mean_albedo, sky_ozone_at_wavelength);
	stage_upload_block(context);
	light->radiance = malloc((size_t)directions->view_count * (size_t)directions->azimuth_count * 3 * sizeof *light->radiance);
	const struct air_tables *air = light->radiance ? air_tables_get(stage, context, scene, mean_albedo) : NULL;
	if (!air || !diffuse_irradiance(stage, air, 0, light->diffuse_irradiance) ||
	    !radiance_along(stage, context, air, directions, light->radiance))
		return stage_fails(context, "sky");
	sun_irradiance(&context->block, 0, sun);
	for (int band = 0; band < 3; band++) {
		light->direct_transmittance[band] = sun[band] / colour_solar_irradiance[band];
		light->diffuse_irradiance[band] /= colour_solar_irradiance[band];
	}
	return true;
}
