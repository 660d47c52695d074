#include "renderer/stages/stage.h"

#include <epoxy/gl.h>

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
