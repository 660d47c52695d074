#include "renderer/stages/view_up.h"

#include "renderer/log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* As in shaders/lib/view_up.glsl and shaders/lib/sky_table.glsl. */
enum { FIRST_WIDTH = 1024, FIRST_HEIGHT = 64, LIGHT_SIDE = 64, LIGHT_DEPTHS = 24, AIR_WIDTH = 96, AIR_HEIGHT = 160 };

#define DEFINES                                                                                                                            \
	"#define VIEW_CLOUDS 1\n#define VIEW_ABOVE 0\n#define VIEW_SOLVED 1\n#define VIEW_TWILIGHT 0\n#define VIEW_COLOR_ONLY 1\n#define " \
	"VIEW_REGION 2\n"

static const struct pass_desc air_desc = {.file = "shaders/passes/view_up_air.glsl",
					  .outputs = VIEW_UP_AIR_TABLES,
					  .samplers = {"sky_total", "sky_near", "air_to_layer", "air_to_end"}};
static const struct pass_desc first_desc = {
	.file = "shaders/passes/view_up_first.glsl", .defines = DEFINES, .outputs = 1, .samplers = {"phase_table", "event_table"}};
static const struct pass_desc light_desc = {
	.file = "shaders/passes/view_up_light.glsl", .defines = DEFINES, .outputs = 1, .samplers = {"slab_slices", "slab_table"}};

const struct pass *view_up_pass(struct view_up_stage *stage, enum projection projection, bool packed, enum view_up_reach reach,
				enum view_up_disc disc, int details)
{
	static const char *const reaches[VIEW_UP_REACHES] = {"", "#define FIELD_NEAR 1\n", "#define SIDE_LOW 1\n", "#define SIDE_LOW 2\n"};
	struct pass **pass = &stage->look[projection][packed][reach][disc][details - 1];
	char defines[512];
	snprintf(defines, sizeof defines,
		 "%s%s%s#ifndef SIDE_LOW\n#define SIDE_LOW 0\n#endif\n#define VIEW_PROJECTION %d\n#define UP_DISC %d\n#define "
		 "VIEW_LARGE_SUN %d\n#define FIELD_DETAIL_TILES %d\n",
		 DEFINES, packed ? "#define FIELD_PACKED 1\n" : "", reaches[reach], projection, disc != VIEW_UP_NO_DISC,
		 disc == VIEW_UP_LARGE_DISC, details);
	if (!*pass)
		*pass = pass_create(&stage->compiler, &(struct pass_desc){.file = "shaders/passes/view_up.glsl",
									  .defines = defines,
									  .outputs = 1,
									  .samplers = {"field_coarse", "field_detail", "thickness_packed",
										       "side_light", "cloud_received", "up_sky", "up_air",
										       "up_sun", "up_first", "up_light"}});
	return *pass;
}

bool view_up_init(struct view_up_stage *stage, const struct pass_compiler *compiler)
{
	stage->compiler = *compiler;
	bool ok = (stage->air = pass_create(compiler, &air_desc)) && (stage->first = pass_create(compiler, &first_desc)) &&
		  (stage->light = pass_create(compiler, &light_desc));
	for (int i = 0; ok && i < VIEW_UP_AIR_TABLES; i++)
		ok = texture_init(&stage->air_tables[i], AIR_WIDTH, AIR_HEIGHT, TEXTURE_RGBA32F, 0);
	ok = ok && view_up_pass(stage, PROJECTION_PERSPECTIVE, true, VIEW_UP_FAR, false, 1) &&
	     view_up_pass(stage, PROJECTION_PERSPECTIVE, true, VIEW_UP_LOW, VIEW_UP_NO_DISC, 1) &&
	     view_up_pass(stage, PROJECTION_PERSPECTIVE, true, VIEW_UP_SOME_LOW, VIEW_UP_NO_DISC, 1);
	if (!ok)
		view_up_finish(stage);
	return ok;
}

void view_up_finish(struct view_up_stage *stage)
{
	struct pass **look = &stage->look[0][0][0][0][0];
	for (size_t i = 0; i < sizeof stage->look / sizeof *look; i++)
		pass_destroy(look[i]);
	for (int i = 0; i < VIEW_UP_AIR_TABLES; i++)
		texture_finish(&stage->air_tables[i]);
	texture_finish(&stage->received);
	pass_destroy(stage->light);
	pass_destroy(stage->first);
	pass_destroy(stage->air);
	*stage = (struct view_up_stage){0};
}

static void table_destroy(void *value)
{
	struct texture *table = value;
	if (table)
		texture_finish(table);
	free(table);
}

/* A table by one pass, from the cache or made. */
static const struct texture *table_get(struct stage_context *context, const struct cache_key *key, const struct pass *pass, int width,
				       int height, const struct pass_run *from)
{
	struct texture *table = cache_find(context->cache, key);
	if (table)
		return table;
	table = calloc(1, sizeof *table);
	if (table && texture_init(table, width, height, TEXTURE_RGBA32F, 0)) {
		struct pass_run run = *from;
		run.targets = &table;
		pass_run(pass, &run);
		if (cache_keep(context->cache, key, table, texture_bytes(table), table_destroy))
			return table;
	} else {
		table_destroy(table);
	}
	log_error("view: out of memory");
	return NULL;
}

static struct cache_key light_key(const struct scene *scene)
{
	struct cache_key key = cache_key_make("up light");
	const double inputs[] = {scene->sun.elevation_deg, scene->camera.position_m[2], scene->clouds.base_m, scene->clouds.thickness_m};
	droplets_key_add(&key, scene);
	for (size_t i = 0; i < sizeof inputs / sizeof *inputs; i++)
		cache_key_add(&key, inputs[i]);
	return key;
}

bool view_up_prepare(struct view_up_stage *stage, struct stage_context *context, const struct scene *scene,
		     const struct view_up_inputs *inputs, struct pass_run *run)
{
	struct cache_key first_key = cache_key_make("up first");
	const struct cache_key light = light_key(scene);
	droplets_key_add(&first_key, scene);
	const struct sky_tables *sky = inputs->sky;
	const struct field_maps *field = inputs->field;
	struct texture *air[] = {&stage->air_tables[0], &stage->air_tables[1], &stage->air_tables[2]};
	/* One level alone: software renderers look levels up for each pixel. */
	texture_finish(&stage->received);
	stage->received = texture_level(inputs->light->cloud_received, 0);
	texture_filter_linearly(&stage->received);
	pass_run(stage->air, &(struct pass_run){.targets = air, .samplers = {sky->total, sky->near, sky->to_layer, sky->to_end}});
	const struct texture *samplers[] = {
		field->coarse_packed ? field->coarse_packed : field->coarse,
		field->detail_packed ? field->detail_packed : field->detail,
		field->thickness_packed,
		field->sides,
		&stage->received,
		air[0],
		air[1],
		air[2],
		table_get(context, &first_key, stage->first, FIRST_WIDTH, FIRST_HEIGHT,
			  &(struct pass_run){.samplers = {&inputs->droplets->phase, &inputs->droplets->events}}),
		table_get(context, &light, stage->light, LIGHT_SIDE, LIGHT_SIDE * LIGHT_DEPTHS,
			  &(struct pass_run){.samplers = {inputs->slab_slices, inputs->slab_rows}}),
	};
	const size_t count = sizeof samplers / sizeof *samplers;
	memcpy(run->samplers, samplers, sizeof samplers);
	return samplers[count - 2] && samplers[count - 1];
}
