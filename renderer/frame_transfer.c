#include "renderer/frame_transfer.h"

#include "renderer/log.h"

#include <epoxy/gl.h>
#include <stdlib.h>
#include <string.h>

_Static_assert((int)RENDERER_TRANSFERS_MAX == (int)READBACK_SLOTS, "each has a place");

void transfers_finish(struct frame_transfers *transfers)
{
	for (int i = 0; i < READBACK_SLOTS; i++)
		for (int stage = 0; stage < STAGE_COUNT; stage++)
			gl_timer_finish(&transfers->transfers[i].timers[stage]);
	readback_finish(&transfers->readback);
}

/* --- departure --------------------------------------------------------------------------------------------------------------------- */

/* Inlined, so that the compiler knows the size. */
static inline void pack(unsigned char *to, const unsigned char *from, size_t count, size_t component)
{
	for (size_t i = 0; i < count; i++, to += 3 * component, from += 4 * component)
		memmove(to, from, 3 * component);
}

/* Drops every fourth component; `to` may be `from`. */
static void pack_rgb(unsigned char *to, const unsigned char *from, size_t count, size_t component)
{
	if (component == 1)
		pack(to, from, count, 1);
	else if (component == 2)
		pack(to, from, count, 2);
	else
		pack(to, from, count, 4);
}

static size_t component_bytes(const struct frame *frame)
{
	return frame->type == PIXEL_F32 ? 4 : frame->type == PIXEL_U16 ? 2 : 1;
}

static GLenum component_type(const struct frame *frame)
{
	return frame->type == PIXEL_F32 ? GL_FLOAT : frame->type == PIXEL_U16 ? GL_UNSIGNED_SHORT : GL_UNSIGNED_BYTE;
}

static size_t texel_count(const struct frame *frame)
{
	return (size_t)frame->width * (size_t)frame->height;
}

/* Has the pixels sent to a buffer, where there is one for them. */
static bool send_pixels(struct frame_transfers *transfers, struct frame *frame, const struct texture *const *pictures)
{
	const size_t plane = texel_count(frame) * 4 * component_bytes(frame);
	struct readback_slot *slot = readback_lend(&transfers->readback, plane * (size_t)frame->layer_count);
	if (!slot)
		return false;
	for (int i = 0; i < frame->layer_count; i++)
		readback_copy(slot, pictures[i]->id, component_type(frame), (size_t)i * plane, plane);
	frame->transfer = &transfers->transfers[slot - transfers->readback.slots];
	frame->transfer->slot = slot;
	return true;
}

/* Waits for the GPU and reads. */
static bool read_pixels(struct frame *frame, const struct texture *const *pictures)
{
	const size_t component = component_bytes(frame), texels = texel_count(frame), plane = texels * 3 * component;
	glFinish();
	const double begin = clock_milliseconds();
	/* Room for the fourth component of the last layer while it is packed. */
	unsigned char *pixels = frame->pixels = malloc(frame->bytes + texels * component);
	if (!pixels)
		return false;
	for (int i = 0; i < frame->layer_count; i++) {
		glGetTextureImage(pictures[i]->id, 0, GL_RGBA, component_type(frame), (GLsizei)(texels * 4 * component),
				  pixels + (size_t)i * plane);
		pack_rgb(pixels + (size_t)i * plane, pixels + (size_t)i * plane, texels, component);
	}
	frame->timing[STAGE_READBACK].milliseconds = clock_milliseconds() - begin;
	return true;
}

bool transfers_read(struct frame_transfers *transfers, struct frame *frame, const struct texture *const *pictures)
{
	frame->bytes = texel_count(frame) * 3 * component_bytes(frame) * (size_t)frame->layer_count;
	return send_pixels(transfers, frame, pictures) || read_pixels(frame, pictures);
}

/* Of a picture that travels the read-back is the GPU's copy and what follows in frame_take_pixels; else it is measured as it is done. */
static bool on_processor(enum stage stage, const struct frame *frame)
{
	return stage == STAGE_OPTICS || (stage == STAGE_READBACK && !frame->transfer);
}

/* The timers that ran go with a picture that travels; those of the last one that went this way are for the next. */
static void send_off(struct transfer *transfer, struct gl_timer timers[static STAGE_COUNT])
{
	struct gl_timer kept[STAGE_COUNT];
	memcpy(kept, transfer->timers, sizeof kept);
	memcpy(transfer->timers, timers, sizeof kept);
	memcpy(timers, kept, sizeof kept);
	readback_send(transfer->slot);
}

void transfers_depart(struct frame *frame, struct gl_timer timers[static STAGE_COUNT])
{
	for (int i = 0; i < STAGE_COUNT; i++)
		if (!on_processor((enum stage)i, frame))
			frame->timing[i].milliseconds = frame->transfer ? 0 : gl_timer_milliseconds(&timers[i]);
	if (frame->transfer)
		send_off(frame->transfer, timers);
}

/* --- arrival ----------------------------------------------------------------------------------------------------------------------- */

enum render_result renderer_arrive(struct renderer *renderer, struct frame *frame, double milliseconds)
{
	struct transfer *transfer = frame->transfer;
	(void)renderer; /* whose thread it is */
	if (!transfer)
		return RENDER_OK;
	switch (readback_await(transfer->slot, milliseconds)) {
	case READBACK_TRAVELS:
		return RENDER_UNFINISHED;
	case READBACK_LOST:
		log_error("renderer: a picture did not arrive");
		frame_finish(frame);
		return RENDER_FAILED;
	case READBACK_ARRIVED:
		break;
	}
	for (int i = 0; i < STAGE_COUNT; i++)
		if (!on_processor((enum stage)i, frame))
			frame->timing[i].milliseconds += gl_timer_milliseconds(&transfer->timers[i]);
	return RENDER_OK;
}

bool frame_take_pixels(struct frame *frame)
{
	if (!frame->transfer)
		return true;
	const double begin = clock_milliseconds();
	struct readback_slot *slot = frame->transfer->slot;
	frame->pixels = malloc(frame->bytes);
	if (frame->pixels)
		pack_rgb(frame->pixels, slot->mapped, texel_count(frame) * (size_t)frame->layer_count, component_bytes(frame));
	frame->transfer = NULL;
	readback_give_back(slot);
	frame->timing[STAGE_READBACK].milliseconds += clock_milliseconds() - begin;
	return frame->pixels;
}

void frame_drop_pixels(struct frame *frame)
{
	if (frame->transfer)
		readback_give_back(frame->transfer->slot);
	frame->transfer = NULL;
	free(frame->pixels);
	frame->pixels = NULL;
}

void frame_finish(struct frame *frame)
{
	frame_drop_pixels(frame);
	*frame = (struct frame){0};
}
