/* The sun's disc in every view of a picture, in the buffer that shaders/lib/sun_disc.glsl reads. The thread that owns the context calls. */
#ifndef STRATUS_RENDERER_STAGES_DISC_H
#define STRATUS_RENDERER_STAGES_DISC_H

#include "renderer/camera.h"
#include "renderer/sun_disc.h"
#include "renderer/scene_block.h"

#include <stddef.h>

/* Most views of a picture. */
enum { DISC_VIEWS = FACE_ALL };

struct disc_buffer {
	unsigned buffer; /* OpenGL name; 0 before the first filling */
	struct disc_view {
		size_t offset, bytes; /* of its weights in the buffer */
		float box[4];         /* the block's member sun_disc_box */
		bool large;           /* sun_disc.large: the weights say nothing */
	} views[DISC_VIEWS];
};

/* Spreads the disc over the views of a picture (renderer/sun_disc.h). sine: of the horizon's elevation. Waits for pictures that are being
 * drawn with what was there before. cover: of the sun; NULL is none. false when out of memory. */
bool disc_buffer_fill(struct disc_buffer *disc, const struct scene_block *block, const struct scene *scene, double horizon_sine,
		      const struct sun_cover *cover);

/* Binds the weights of one view and writes its box into the block; the caller uploads that. */
void disc_buffer_bind(const struct disc_buffer *disc, int view, struct scene_block *block);

/* Takes a zeroed one; zeroes it. */
void disc_buffer_finish(struct disc_buffer *disc);

#endif
