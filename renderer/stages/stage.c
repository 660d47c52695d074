#include "renderer/stages/stage.h"

#include "renderer/log.h"
#include "renderer/scene_map.h"

#include <epoxy/gl.h>

bool stage_is_stopped(struct stage_context *context)
{
	if (!context->cancelled || context->stopped)
		return context->stopped;
	glFinish();
	context->stopped = context->cancelled(context->cancel_context);
	return context->stopped;
}

bool stage_fails(const struct stage_context *context, const char *stage)
{
	if (!context->stopped)
		log_error("%s: out of memory", stage);
	return false;
}

void stage_upload_block(struct stage_context *context)
{
	glNamedBufferSubData(context->block_buffer, 0, sizeof context->block, &context->block);
	glBindBufferBase(GL_UNIFORM_BUFFER, SCENE_BLOCK_BINDING, context->block_buffer);
}

void stage_read_texture(const struct texture *texture, int level, int components, float *values)
{
	const int width = texture->width >> level ? texture->width >> level : 1;
	const int height = texture->height >> level ? texture->height >> level : 1;
	glGetTextureImage(texture->id, level, components == 1 ? GL_RED : GL_RGBA, GL_FLOAT,
			  (GLsizei)((size_t)width * (size_t)height * (size_t)components * sizeof *values), values);
}

void stage_key_add_light(struct cache_key *key, const struct scene *scene)
{
	const struct scene_clouds *clouds = &scene->clouds;
	const double inputs[] = {scene->sun.elevation_deg,
				 scene->sun.azimuth_deg,
				 scene->dsd.n0_per_cm3,
				 scene->dsd.gamma,
				 scene->dsd.effective_radius_um,
				 clouds->type,
				 clouds->seed,
				 clouds->time_s,
				 clouds->coverage,
				 clouds->base_m,
				 clouds->thickness_m,
				 clouds->tile_m,
				 clouds->resolution,
				 clouds->wind_mps[0],
				 clouds->wind_mps[1],
				 scene->ground.type,
				 scene->ground.albedo[0],
				 scene->ground.albedo[1],
				 scene->ground.albedo[2],
				 scene->ground.albedo_scale,
				 scene->atmosphere.aerosol_optical_depth,
				 scene->atmosphere.ozone_du,
				 scene->radiosity.enabled,
				 scene->radiosity.tolerance,
				 scene->radiosity.max_passes,
				 scene->model.shading,
				 scene->model.optics};
	for (size_t i = 0; i < sizeof inputs / sizeof *inputs; i++)
		cache_key_add(key, inputs[i]);
	stage_key_add_map(key, clouds->map.map);
	stage_key_add_map(key, scene->ground.map.map);
}

void stage_key_add_map(struct cache_key *key, const struct scene_map *map)
{
	static const unsigned char none[SCENE_MAP_HASH_BYTES];
	cache_key_add_bytes(key, map ? map->hash : none, SCENE_MAP_HASH_BYTES);
}

bool stage_create_passes(const struct pass_compiler *compiler, const struct pass_desc *descs, struct pass **passes, int count)
{
	for (int i = 0; i < count; i++) {
		passes[i] = pass_create(compiler, &descs[i]);
		if (!passes[i]) {
			stage_destroy_passes(passes, i);
			return false;
		}
	}
	return true;
}

void stage_destroy_passes(struct pass **passes, int count)
{
	for (int i = 0; i < count; i++) {
		pass_destroy(passes[i]);
		passes[i] = NULL;
	}
}
