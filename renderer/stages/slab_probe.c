#include "renderer/stages/slab_probe.h"

#include <stdlib.h>

enum { WIDTH = 256 };

static const struct pass_desc desc = {
	.file = "shaders/passes/slab_probe.glsl", .outputs = 2, .samplers = {"phase_table", "event_table", "slab_slices", "probes"}};

bool slab_probe_prepare(struct stage_context *context, const struct scene *scene, struct slab_probe_frame *frame)
{
	*frame = (struct slab_probe_frame){.droplets = droplets_get(context, scene)};
	if (!frame->droplets || !slab_slices_get(context, scene, frame->droplets, &frame->slices))
		return false;
	stage_upload_block(context);
	const float *range = context->block.slab_slice_range;
	frame->mu_first = slab_slices_cosine(range[0]);
	frame->mu_last = slab_slices_cosine(range[0] + (range[2] - 1) / range[1]);
	for (int i = 0; i < 2; i++)
		frame->lit[i] = context->block.slab_light[i] > 0;
	return true;
}

static void fill(const struct slab_probe *probes, int count, int texels, float (*values)[4])
{
	for (int i = 0; i < texels; i++) {
		const struct slab_probe *probe = &probes[i < count ? i : count - 1];
		values[i][0] = (float)probe->thickness_m;
		values[i][1] = (float)probe->mu_l;
		values[i][2] = (float)probe->mu_v;
		values[i][3] = (float)probe->azimuth;
	}
}

static void take(const float (*first)[4], const float (*multiple)[4], int count, struct slab_probe_light *light)
{
	for (int i = 0; i < count; i++)
		for (int band = 0; band < BAND_COUNT; band++) {
			light[i].first[band] = first[i][band];
			light[i].multiple[band] = multiple[i][band];
		}
}

bool slab_probe_run(const struct pass_compiler *compiler, const struct slab_probe_frame *frame, const struct scene *scene, bool base,
		    const struct slab_probe *probes, int count, struct slab_probe_light *light)
{
	const int height = (count + WIDTH - 1) / WIDTH, texels = WIDTH * height;
	const bool from_above = scene->camera.position_m[2] >= scene->clouds.base_m;
	struct texture inputs = {0}, outputs[2] = {{0}};
	float(*values)[4] = malloc(3 * (size_t)texels * sizeof *values);
	struct pass *pass = pass_create(compiler, &desc);
	bool ok = values && pass && frame->lit[base] && texture_init(&inputs, WIDTH, height, TEXTURE_RGBA32F, TEXTURE_NEAREST);
	for (int i = 0; ok && i < 2; i++)
		ok = texture_init(&outputs[i], WIDTH, height, TEXTURE_RGBA32F, TEXTURE_NEAREST);
	if (ok) {
		fill(probes, count, texels, values);
		texture_upload(&inputs, &values[0][0]);
		pass_run(pass, &(struct pass_run){.targets = (struct texture *[]){&outputs[0], &outputs[1]},
						  .samplers = {&frame->droplets->phase, &frame->droplets->events, frame->slices, &inputs},
						  .arguments = {{base == from_above, base && frame->lit[0] ? 1 : 0}}});
		stage_read_texture(&outputs[0], 0, 4, &values[texels][0]);
		stage_read_texture(&outputs[1], 0, 4, &values[2 * texels][0]);
		take((const float(*)[4])values + texels, (const float(*)[4])values + 2 * texels, count, light);
	}
	texture_finish(&outputs[1]);
	texture_finish(&outputs[0]);
	texture_finish(&inputs);
	pass_destroy(pass);
	free(values);
	return ok;
}
