#include "renderer/gl/texture.h"

#include "renderer/gl/context.h"

#include <epoxy/gl.h>

static const struct {
	GLenum internal, external;
	size_t texel_bytes;
} formats[] = {
	[TEXTURE_R32F] = {GL_R32F, GL_RED, 4},         [TEXTURE_RG32F] = {GL_RG32F, GL_RG, 8},
	[TEXTURE_RGBA32F] = {GL_RGBA32F, GL_RGBA, 16}, [TEXTURE_RGBA16F] = {GL_RGBA16F, GL_RGBA, 8},
	[TEXTURE_RGBA8] = {GL_RGBA8, GL_RGBA, 4},      [TEXTURE_RGBA16] = {GL_RGBA16, GL_RGBA, 8},
	[TEXTURE_RG16] = {GL_RG16, GL_RG, 4},
};

static int level_count(int width, int height)
{
	int levels = 1;
	for (int size = width > height ? width : height; size > 1; size /= 2)
		levels++;
	return levels;
}

bool texture_init(struct texture *texture, int width, int height, enum texture_format format, int flags)
{
	const bool mipmaps = flags & TEXTURE_MIPMAPS;
	*texture = (struct texture){.width = width, .height = height, .levels = mipmaps ? level_count(width, height) : 1, .format = format};
	glCreateTextures(GL_TEXTURE_2D, 1, &texture->id);
	glTextureStorage2D(texture->id, texture->levels, formats[format].internal, width, height);

	const GLint filter = flags & TEXTURE_NEAREST ? GL_NEAREST : GL_LINEAR;
	const GLint mip_filter = flags & TEXTURE_NEAREST ? GL_NEAREST_MIPMAP_NEAREST : GL_LINEAR_MIPMAP_LINEAR;
	glTextureParameteri(texture->id, GL_TEXTURE_MAG_FILTER, filter);
	glTextureParameteri(texture->id, GL_TEXTURE_MIN_FILTER, mipmaps ? mip_filter : filter);
	glTextureParameteri(texture->id, GL_TEXTURE_WRAP_S, flags & (TEXTURE_REPEAT | TEXTURE_REPEAT_X) ? GL_REPEAT : GL_CLAMP_TO_EDGE);
	glTextureParameteri(texture->id, GL_TEXTURE_WRAP_T, flags & TEXTURE_REPEAT ? GL_REPEAT : GL_CLAMP_TO_EDGE);
	if (gl_failed("texture storage")) {
		texture_finish(texture);
		return false;
	}
	return true;
}

bool texture_init_3d(struct texture *texture, int width, int height, int depth, enum texture_format format, int flags)
{
	static const GLenum wraps[] = {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R};
	const bool mipmaps = flags & TEXTURE_MIPMAPS;
	const int levels = mipmaps ? level_count(width > depth ? width : depth, height) : 1;
	*texture = (struct texture){.width = width, .height = height, .depth = depth, .levels = levels, .format = format};
	glCreateTextures(GL_TEXTURE_3D, 1, &texture->id);
	glTextureStorage3D(texture->id, levels, formats[format].internal, width, height, depth);
	glTextureParameteri(texture->id, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
	glTextureParameteri(texture->id, GL_TEXTURE_MIN_FILTER, mipmaps ? GL_LINEAR_MIPMAP_LINEAR : GL_LINEAR);
	for (int i = 0; i < 3; i++)
		glTextureParameteri(texture->id, wraps[i], flags & TEXTURE_REPEAT ? GL_REPEAT : GL_CLAMP_TO_EDGE);
	if (gl_failed("texture storage")) {
		texture_finish(texture);
		return false;
	}
	return true;
}

void texture_upload(const struct texture *texture, const float *values)
{
	if (texture->depth > 0)
		glTextureSubImage3D(texture->id, 0, 0, 0, 0, texture->width, texture->height, texture->depth,
				    formats[texture->format].external, GL_FLOAT, values);
	else
		glTextureSubImage2D(texture->id, 0, 0, 0, texture->width, texture->height, formats[texture->format].external, GL_FLOAT,
				    values);
}

void texture_build_mipmaps(const struct texture *texture)
{
	glGenerateTextureMipmap(texture->id);
}

struct texture texture_level(const struct texture *texture, int level)
{
	struct texture view = {.levels = 1, .format = texture->format};
	view.width = texture->width >> level > 0 ? texture->width >> level : 1;
	view.height = texture->height >> level > 0 ? texture->height >> level : 1;
	glGenTextures(1, &view.id);
	glTextureView(view.id, GL_TEXTURE_2D, texture->id, formats[texture->format].internal, (GLuint)level, 1, 0, 1);
	glTextureParameteri(view.id, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
	glTextureParameteri(view.id, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
	return view;
}

void texture_filter_linearly(struct texture *texture)
{
	glTextureParameteri(texture->id, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
	glTextureParameteri(texture->id, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
}

size_t texture_bytes(const struct texture *texture)
{
	size_t bytes = 0;
	for (int level = 0; level < texture->levels; level++) {
		const int width = texture->width >> level, height = texture->height >> level;
		bytes += formats[texture->format].texel_bytes * (size_t)(width ? width : 1) * (size_t)(height ? height : 1) *
			 (size_t)(texture->depth ? texture->depth : 1);
	}
	return texture->id ? bytes : 0;
}

void texture_finish(struct texture *texture)
{
	if (texture->id)
		glDeleteTextures(1, &texture->id);
	*texture = (struct texture){0};
}

unsigned texture_internal_format(enum texture_format format)
{
	return formats[format].internal;
}
