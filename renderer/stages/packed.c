#include "renderer/stages/packed.h"

#include "renderer/log.h"

#include <stdlib.h>

static const struct pass_desc desc = {.file = "shaders/passes/pack.glsl", .outputs = 1, .samplers = {"picture"}};

struct pass *packed_pass_create(const struct pass_compiler *compiler)
{
	return pass_create(compiler, &desc);
}

static void packed_destroy(void *value)
{
	struct texture *packed = value;
	if (packed)
		texture_finish(packed);
	free(packed);
}

static struct texture *packed_compute(const struct pass *pack, const struct texture *picture, enum texture_format format)
{
	const int side = picture->width;
	struct texture *packed = calloc(1, sizeof *packed);
	if (!packed || !texture_init(packed, side + side / 2, side, format, TEXTURE_NEAREST)) {
		packed_destroy(packed);
		return NULL;
	}
	pass_run(pack, &(struct pass_run){.targets = &packed, .samplers = {picture}, .arguments = {{(float)side}}});
	return packed;
}

const struct texture *packed_get(const struct pass *pack, struct stage_context *context, const struct cache_key *key,
				 const struct texture *picture, enum texture_format format)
{
	struct texture *packed = cache_find(context->cache, key);
	if (packed)
		return packed;
	context->reused = false;
	packed = packed_compute(pack, picture, format);
	if (packed && cache_keep(context->cache, key, packed, texture_bytes(packed), packed_destroy))
		return packed;
	log_error("packed picture: out of memory");
	return NULL;
}
