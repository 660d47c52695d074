#include "renderer/stages/disc.h"

#include "renderer/log.h"

#include <epoxy/gl.h>
#include <stdlib.h>
#include <string.h>

enum {
	DISC_BINDING = 1, /* in shaders/lib/sun_disc.glsl */
	ALIGNMENT = 256   /* the largest that OpenGL lets a device ask for */
};

static size_t count_of(const struct sun_disc *disc)
{
	return (size_t)disc->width * (size_t)disc->height;
}

static void describe(struct disc_view *view, const struct sun_disc *disc, size_t offset)
{
	const float box[4] = {(float)disc->column, (float)disc->row, (float)disc->width, (float)disc->height};
	const float scale[4] = {disc->visible > 0 ? (float)(1 / disc->visible) : 0};
	memcpy(view->box, disc->large ? scale : box, sizeof view->box);
	view->large = disc->large;
	view->offset = offset;
	view->bytes = (count_of(disc) ? count_of(disc) : 1) * 3 * sizeof *disc->weights; /* nothing at all cannot be bound */
}

/* By its target, not by its name: Mesa 22.3 forgets for buffers filled by name that they are read by shaders, and overwrites them under
 * software pictures that are still being drawn. */
static void upload(struct disc_buffer *disc, const void *data, size_t bytes)
{
	if (!disc->buffer)
		glCreateBuffers(1, &disc->buffer);
	glBindBuffer(GL_SHADER_STORAGE_BUFFER, disc->buffer);
	glBufferData(GL_SHADER_STORAGE_BUFFER, (GLsizeiptr)bytes, data, GL_DYNAMIC_DRAW);
}

/* Three bands a pixel. */
static void write_light(float *to, const struct sun_disc *disc)
{
	for (size_t i = 0; disc->weights && i < count_of(disc); i++)
		for (int band = 0; band < 3; band++)
			to[3 * i + (size_t)band] = disc->weights[i] * disc->passed[i][band];
}

bool disc_buffer_fill(struct disc_buffer *disc, const struct scene_block *block, const struct scene *scene, double horizon_sine,
		      const struct sun_cover *cover)
{
	const double sun[3] = {block->sun_direction[0], block->sun_direction[1], block->sun_direction[2]};
	const int count = camera_view_count(scene);
	struct sun_disc discs[DISC_VIEWS] = {0};
	unsigned char *data = NULL;
	size_t bytes = 0;
	bool ok = true;
	for (int i = 0; ok && i < count; i++) {
		const struct camera_view view = camera_view_of(scene, i);
		ok = sun_disc_init(&discs[i], &view, sun, block->sun_direction[3], horizon_sine, cover);
		describe(&disc->views[i], &discs[i], bytes);
		bytes += (disc->views[i].bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
	}
	if (ok && !(data = calloc(1, bytes))) {
		log_error("sun's disc: out of memory");
		ok = false;
	}
	for (int i = 0; ok && i < count; i++)
		write_light((float *)(void *)(data + disc->views[i].offset), &discs[i]);
	if (ok)
		upload(disc, data, bytes);
	free(data);
	for (int i = 0; i < count; i++)
		sun_disc_finish(&discs[i]);
	return ok;
}

void disc_buffer_bind(const struct disc_buffer *disc, int view, struct scene_block *block)
{
	glBindBufferRange(GL_SHADER_STORAGE_BUFFER, DISC_BINDING, disc->buffer, (GLintptr)disc->views[view].offset,
			  (GLsizeiptr)disc->views[view].bytes);
	memcpy(block->sun_disc_box, disc->views[view].box, sizeof block->sun_disc_box);
}

void disc_buffer_finish(struct disc_buffer *disc)
{
	if (disc->buffer)
		glDeleteBuffers(1, &disc->buffer);
	*disc = (struct disc_buffer){0};
}
