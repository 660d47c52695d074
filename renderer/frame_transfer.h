/* Frames on their way from the GPU: by way of a buffer while the next picture is begun, or read at once. What renderer.h says of pictures
 * that travel (renderer_arrive, frame_take_pixels and what follows) is done here too.
 */
#ifndef STRATUS_RENDERER_FRAME_TRANSFER_H
#define STRATUS_RENDERER_FRAME_TRANSFER_H

#include "renderer/gl/readback.h"
#include "renderer/gl/texture.h"
#include "renderer/gl/timer.h"
#include "renderer/renderer.h"

/* A picture on its way, and the timers of its stages, to be read when it is there. */
struct transfer {
	struct readback_slot *slot;
	struct gl_timer timers[STAGE_COUNT];
};

/* Of one renderer. Zero: nothing allocated. */
struct frame_transfers {
	struct readback readback;
	struct transfer transfers[READBACK_SLOTS]; /* of its slots */
};

/* Waits for frames whose pixels are still here. Takes a zeroed one. */
void transfers_finish(struct frame_transfers *transfers);

/* Has the pixels of a frame of known size, type and layers sent, or waits for the GPU and reads them. pictures: one for each layer. false
 * when out of memory. */
bool transfers_read(struct frame_transfers *transfers, struct frame *frame, const struct texture *const *pictures);

/* All stages of the frame have been run, between these timers: reads them, or has them travel with the picture in place of others. */
void transfers_depart(struct frame *frame, struct gl_timer timers[static STAGE_COUNT]);

#endif
