/* What a renderer consists of. For renderer.c and what it is written in parts with (frame_job.c) alone; all others see renderer.h. */
#ifndef STRATUS_RENDERER_RENDERER_PARTS_H
#define STRATUS_RENDERER_RENDERER_PARTS_H

#include "renderer/frame_transfer.h"
#include "renderer/gl/context.h"
#include "renderer/gl/timer.h"
#include "renderer/renderer.h"
#include "renderer/stages/ground.h"
#include "renderer/stages/illuminance.h"
#include "renderer/stages/reference.h"
#include "renderer/stages/sea.h"
#include "renderer/stages/sun_cover.h"

struct renderer {
	struct gl_context *gl;
	struct renderer_info info;
	struct stage_context context;
	struct ground_stage ground;
	struct sky_stage sky;
	struct field_stage field;
	struct radiosity_stage radiosity;
	struct view_stage view;
	struct reference_stage reference;
	struct illuminance_stage illuminance;
	struct sun_cover_stage sun_cover;
	struct sea_stage sea;
	struct gl_timer timers[STAGE_COUNT];
	struct frame_transfers transfers;
	struct texture developed; /* of the last picture that is codes; its memory serves the next one */
};

#endif
