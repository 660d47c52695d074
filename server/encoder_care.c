#include "server/encoder_care.h"

#include "renderer/log.h"
#include "server/clock.h"

#include <stdlib.h>

/* So many on end may be pictures for which there is no memory; whether small ones can be written is then to be seen. */
enum { FAILURES_MAX = 3, TRIAL_SIDE = 16 };
#define TRIAL_INTERVAL_MS 1000.0

void encoder_care_note(struct encoder_care *care, bool could)
{
	if (could)
		care->failures = 0;
	else
		care->failures++;
}

static bool try_small_picture(const struct image_api *images)
{
	unsigned char pixels[TRIAL_SIDE * TRIAL_SIDE * 3] = {0};
	struct scene scene = scene_default();
	scene.output.width = scene.output.height = TRIAL_SIDE;
	const struct frame frame = {.width = TRIAL_SIDE,
				    .height = TRIAL_SIDE,
				    .type = PIXEL_U8,
				    .channels = 3,
				    .layer_count = 1,
				    .layer = {LAYER_COLOR},
				    .pixels = pixels,
				    .bytes = sizeof pixels};
	const struct image_metadata metadata = {.scene_json = "{}", .request_id = "", .software = "stratus"};
	struct image_buffer file = {0};
	char error[256] = "";
	const bool could = images->encode(&frame, &scene, &metadata, NULL, &file, error, sizeof error);
	if (!could)
		log_error("encoding fails, of a small picture too: %s", error);
	free(file.data);
	return could;
}

void encoder_care_look(struct encoder_care *care, const struct image_api *images)
{
	if (care->failures < FAILURES_MAX || clock_now_ms() < care->tried_ms + TRIAL_INTERVAL_MS)
		return;
	care->tried_ms = clock_now_ms();
	const bool could = try_small_picture(images);
	if (could)
		care->failures = 0;
	care->is_broken = !could;
}

bool encoder_care_is_broken(const struct encoder_care *care)
{
	return care->is_broken;
}
