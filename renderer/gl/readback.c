#include "renderer/gl/readback.h"

#include "renderer/gl/context.h"

#include "renderer/log.h"

#include <epoxy/gl.h>
#include <unistd.h>

/* Persistent and coherent: mapped once, and right to read behind the fence without another call. Of the client's memory, since the
 * processor reads it. */
enum { MAP_FLAGS = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT, STORAGE_FLAGS = MAP_FLAGS | GL_CLIENT_STORAGE_BIT };

/* Whoever holds a picture that has arrived is about to take it. */
enum { LENT_MS_MAX = 10000 };

static void drop_fence(struct readback_slot *slot)
{
	if (slot->fence)
		glDeleteSync(slot->fence);
	slot->fence = NULL;
}

static void drop_buffer(struct readback_slot *slot)
{
	drop_fence(slot);
	if (slot->buffer)
		glDeleteBuffers(1, &slot->buffer); /* which unmaps it */
	slot->buffer = 0;
	slot->capacity = 0;
	slot->mapped = NULL;
}

void readback_finish(struct readback *readback)
{
	for (int i = 0; i < READBACK_SLOTS; i++) {
		struct readback_slot *slot = &readback->slots[i];
		for (int waited_ms = 0; slot->is_lent && waited_ms < LENT_MS_MAX; waited_ms++)
			usleep(1000);
		if (slot->is_lent)
			log_error("read-back: somebody keeps the pixels of a picture");
		drop_buffer(slot);
	}
}

static bool make_buffer(struct readback_slot *slot, size_t bytes)
{
	drop_buffer(slot);
	glCreateBuffers(1, &slot->buffer);
	glNamedBufferStorage(slot->buffer, (GLsizeiptr)bytes, NULL, STORAGE_FLAGS);
	slot->mapped = glMapNamedBufferRange(slot->buffer, 0, (GLsizeiptr)bytes, MAP_FLAGS);
	if (gl_failed("pixel buffer") || !slot->mapped) {
		drop_buffer(slot);
		return false;
	}
	slot->capacity = bytes;
	return true;
}

struct readback_slot *readback_lend(struct readback *readback, size_t bytes)
{
	struct readback_slot *slot = NULL;
	if (bytes > READBACK_BYTES_MAX)
		return NULL;
	/* One that is large enough already, or else any. */
	for (int i = 0; i < READBACK_SLOTS; i++) {
		struct readback_slot *other = &readback->slots[i];
		if (!other->is_lent && (!slot || (slot->capacity < bytes && other->capacity >= bytes)))
			slot = other;
	}
	if (!slot || (slot->capacity < bytes && !make_buffer(slot, bytes)))
		return NULL;
	drop_fence(slot); /* of pixels that nobody waited for: OpenGL copies in order, so that these come after them */
	slot->is_lent = true;
	return slot;
}

void readback_copy(struct readback_slot *slot, unsigned texture, unsigned type, size_t offset, size_t bytes)
{
	glBindBuffer(GL_PIXEL_PACK_BUFFER, slot->buffer);
	glGetTextureImage(texture, 0, GL_RGBA, type, (GLsizei)bytes, (void *)offset);
	glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
}

void readback_send(struct readback_slot *slot)
{
	slot->fence = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
	glFlush();
}

enum readback_state readback_await(struct readback_slot *slot, double milliseconds)
{
	if (!slot->fence)
		return READBACK_LOST; /* OpenGL had none to give */
	if (gl_lost())
		return READBACK_LOST; /* a lost context need not let a fence pass */
	switch (glClientWaitSync(slot->fence, GL_SYNC_FLUSH_COMMANDS_BIT, (GLuint64)(milliseconds * 1e6))) {
	case GL_TIMEOUT_EXPIRED:
		return READBACK_TRAVELS;
	case GL_ALREADY_SIGNALED:
	case GL_CONDITION_SATISFIED:
		drop_fence(slot);
		/* Errors are another picture's, which may be in work now. */
		return gl_was_reset("read-back") ? READBACK_LOST : READBACK_ARRIVED;
	default:
		gl_was_reset("read-back");
		return READBACK_LOST;
	}
}

void readback_give_back(struct readback_slot *slot)
{
	if (slot)
		slot->is_lent = false;
}
