/* Pictures on their way from the GPU to memory: a small ring of pixel buffers that stay mapped, each with a fence.
 *
 * The thread that owns the context has textures copied into a buffer and goes on with other work. Once the fence has been passed the pixels
 * are in memory that any thread may read; who has read them gives the buffer back, without the context.
 */
#ifndef STRATUS_RENDERER_GL_READBACK_H
#define STRATUS_RENDERER_GL_READBACK_H

#include <stdbool.h>
#include <stddef.h>

/* Buffers grow to the pictures they are used for and stay so: for larger pictures none is lent. */
enum { READBACK_SLOTS = 3, READBACK_BYTES_MAX = 48 << 20 };

struct readback_slot {
	unsigned buffer; /* OpenGL name, 0 before the first use */
	size_t capacity;
	const unsigned char *mapped;
	void *fence;          /* GLsync; NULL: none is awaited */
	_Atomic bool is_lent; /* given back by any thread */
};

/* Zero: nothing allocated. */
struct readback {
	struct readback_slot slots[READBACK_SLOTS];
};

/* Deletes the buffers, once they have been given back. Takes a zeroed one. */
void readback_finish(struct readback *readback);

/* A buffer for so many bytes; NULL when all are lent, the picture is too large, or OpenGL has no memory for it (then read at once). */
struct readback_slot *readback_lend(struct readback *readback, size_t bytes);

/* Begins to copy level 0 of a texture to a place in the buffer, as four components of `type` (as OpenGL calls it). */
void readback_copy(struct readback_slot *slot, unsigned texture, unsigned type, size_t offset, size_t bytes);

/* All copies are begun: sends them off. */
void readback_send(struct readback_slot *slot);

enum readback_state { READBACK_TRAVELS, READBACK_ARRIVED, READBACK_LOST };

/* Have they arrived? Waits for it no longer than so many milliseconds. READBACK_LOST: they never will. */
enum readback_state readback_await(struct readback_slot *slot, double milliseconds);

/* The buffer may be lent again. Any thread; also while its pixels travel. Takes NULL. */
void readback_give_back(struct readback_slot *slot);

#endif
