#include "renderer/stages/sky.h"

#include "renderer/log.h"
#include "renderer/stages/colour.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PASS_TRANSMITTANCE, PASS_MULTISCATTER, PASS_VIEW, PASS_RAYS };

static const struct pass_desc pass_descs[SKY_PASS_COUNT] = {
	[PASS_TRANSMITTANCE] = {.file = "shaders/passes/transmittance.glsl", .outputs = 1},
	[PASS_MULTISCATTER] = {.file = "shaders/passes/multiscatter.glsl", .outputs = 1, .samplers = {"transmittance_table"}},
	[PASS_VIEW] = {.file = "shaders/passes/sky_view.glsl", .outputs = 4, .samplers = {"transmittance_table", "multiscatter_table"}},
	[PASS_RAYS] = {.file = "shaders/passes/sky_irradiance_rays.glsl",
		       .outputs = 1,
		       .samplers = {"transmittance_table", "multiscatter_table"}},
};

/* Sizes as in shaders/lib/atmosphere.glsl, sky_table.glsl and passes/sky_irradiance_rays.glsl. */
enum { TRANSMITTANCE_W = 256, TRANSMITTANCE_H = 64, MULTISCATTER_SIDE = 32, VIEW_W = 96, VIEW_H = 160, RAYS_SIDE = 16 };

/* Rayleigh optical thickness of the whole air at 650, 550, 450 nm (Bodhaine et al. 1999, sea level), scale height 8 km. */
static const double rayleigh_thickness[3] = {0.04714702, 0.09297450, 0.21150562};
static const double rayleigh_scale_m = 8000;
/* Aerosol as in the clear-sky comparison of Bruneton 2016 ("A Qualitative and Quantitative Evaluation of 8 Clear Sky Models"): optical
 * depth falling with wavelength^0.8, scale height 1.2 km, single scattering albedo 0.8, Cornette-Shanks asymmetry 0.7. */
static const double aerosol_exponent = 0.8, aerosol_scale_m = 1200, aerosol_albedo = 0.8, aerosol_asymmetry = 0.7;
/* Ozone absorption cross sections in m2 at the bands (Serdyuchenko et al. 2014, 223 K, means over 10 nm); 1 DU is 2.6867e20 molecules per
 * m2; tent from 10 to 40 km, whose integral is its half-width of 15 km. */
static const double ozone_cross_section[3] = {2.4e-25, 3.3e-25, 1.7e-26};
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

static void fill_block(struct scene_block *block, const struct scene *scene, const double mean_albedo[3])
{
	const double elevation = scene->sun.elevation_deg * M_PI / 180, azimuth = scene->sun.azimuth_deg * M_PI / 180;
	block->sun_direction[0] = (float)(cos(elevation) * sin(azimuth));
	block->sun_direction[1] = (float)(cos(elevation) * cos(azimuth));
	block->sun_direction[2] = (float)sin(elevation);
	block->sun_direction[3] = (float)sun_radius;
	for (int band = 0; band < 3; band++) {
		const double wavelength_um = (650 - 100 * band) * 1e-3;
		block->solar_irradiance[band] = (float)colour_solar_irradiance[band];
		block->rayleigh[band] = (float)(rayleigh_thickness[band] / rayleigh_scale_m);
		block->aerosol[band] =
			(float)(scene->atmosphere.aerosol_optical_depth * pow(wavelength_um / 0.55, -aerosol_exponent) / aerosol_scale_m);
		block->ozone[band] = (float)(scene->atmosphere.ozone_du * dobson_per_m2 * ozone_cross_section[band] / ozone_half_width_m);
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
	struct texture transmittance, multiscatter;
};

static void air_tables_destroy(void *value)
{
	struct air_tables *air = value;
	texture_finish(&air->multiscatter);
	texture_finish(&air->transmittance);
	free(air);
}

static struct air_tables *air_tables_compute(const struct sky_stage *stage)
{
	struct air_tables *air = calloc(1, sizeof *air);
	if (!air)
		return NULL;
	if (!texture_init(&air->transmittance, TRANSMITTANCE_W, TRANSMITTANCE_H, TEXTURE_RGBA32F, 0) ||
	    !texture_init(&air->multiscatter, MULTISCATTER_SIDE, MULTISCATTER_SIDE, TEXTURE_RGBA32F, 0)) {
		air_tables_destroy(air);
		return NULL;
	}
	pass_run(stage->passes[PASS_TRANSMITTANCE], &(struct pass_run){.targets = (struct texture *[]){&air->transmittance}});
	pass_run(stage->passes[PASS_MULTISCATTER],
		 &(struct pass_run){.targets = (struct texture *[]){&air->multiscatter}, .samplers = {&air->transmittance}});
	return air;
}

static const struct air_tables *air_tables_get(const struct sky_stage *stage, struct stage_context *context, const struct scene *scene,
					       const double mean_albedo[3])
{
	struct cache_key key = cache_key_make("air");
	cache_key_add(&key, scene->atmosphere.aerosol_optical_depth);
	cache_key_add(&key, scene->atmosphere.ozone_du);
	for (int band = 0; band < 3; band++)
		cache_key_add(&key, mean_albedo[band]);
	struct air_tables *air = cache_find(context->cache, &key);
	if (air)
		return air;
	context->reused = false;
	air = air_tables_compute(stage);
	if (!air || !cache_keep(context->cache, &key, air, texture_bytes(&air->transmittance) + texture_bytes(&air->multiscatter),
				air_tables_destroy))
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
	pass_run(stage->passes[PASS_RAYS], &(struct pass_run){.targets = (struct texture *[]){&rays},
							      .samplers = {&air->transmittance, &air->multiscatter},
							      .arguments = {{(float)height}}});
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
			depth[band] +=
				end / STEPS *
				(block->rayleigh[band] * exp(-h / rayleigh_scale_m) + block->aerosol[band] * exp(-h / aerosol_scale_m) +
				 block->ozone[band] * fmax(0, 1 - fabs(h - ozone_peak_m) / ozone_half_width_m));
	}
	for (int band = 0; band < 3; band++)
		irradiance[band] = visible * block->solar_irradiance[band] * exp(-depth[band]);
}

static struct sky_view *sky_view_compute(const struct sky_stage *stage, const struct stage_context *context, const struct air_tables *air,
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
	pass_run(stage->passes[PASS_VIEW], &(struct pass_run){.targets = targets, .samplers = {&air->transmittance, &air->multiscatter}});
	if (!diffuse_irradiance(stage, air, cloud_height, view->diffuse_cloud) || !diffuse_irradiance(stage, air, 0, view->diffuse_ground))
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
	fill_block(&context->block, scene, mean_albedo);
	stage_upload_block(context);
	const struct air_tables *air = air_tables_get(stage, context, scene, mean_albedo);
	const struct sky_view *view = air ? sky_view_get(stage, context, scene, mean_albedo, air) : NULL;
	if (!view) {
		log_error("sky: out of memory");
		return false;
	}
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
