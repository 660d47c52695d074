/* Looks after the renderer, for the thread that owns it: proves that it renders (golden.h), and makes it anew when its OpenGL context was
 * lost, renders wrongly, or has grown.
 *
 * The owner's thread calls, but for what says otherwise.
 */
#ifndef STRATUS_SERVER_RENDERER_CARE_H
#define STRATUS_SERVER_RENDERER_CARE_H

#include "renderer/renderer.h"
#include "server/config.h"
#include "server/heartbeat.h"

/* Why a renderer is made anew. */
enum care_reason {
	CARE_NONE,
	CARE_GUILTY,   /* the driver reset the context, for what was rendered in it */
	CARE_INNOCENT, /* for what another did */
	CARE_UNKNOWN,  /* for who knows what */
	CARE_GOLDEN,   /* the golden render failed */
	CARE_FAILURES, /* renders failed one after the other */
	CARE_MEMORY,   /* its memory has grown beyond --recycle-mb */
	CARE_REASON_COUNT
};

/* "guilty", "innocent", "unknown", "golden", "failures", "memory"; none for CARE_NONE */
extern const char *const care_reason_names[CARE_REASON_COUNT];

struct care_counts {
	unsigned long resets[CARE_REASON_COUNT];
	unsigned long golden_passed, golden_failed;
	unsigned long repeated; /* renders that a lost context interrupted, and that were begun again */
};

struct renderer_care;

/* Brings the renderer up and has it prove itself. heartbeat: of the thread. All must outlive it. NULL (and log lines) on failure. */
struct renderer_care *renderer_care_create(const struct config *config, struct droplet_store *droplets, struct heartbeat *heartbeat);
/* Ends the renderer; what other threads may read stays. */
void renderer_care_close(struct renderer_care *care);
/* Frees everything, after renderer_care_close. Any thread. Takes NULL. */
void renderer_care_destroy(struct renderer_care *care);

/* Never NULL but after a failed renderer_care_rebuild. */
struct renderer *renderer_care_renderer(const struct renderer_care *care);

/* Looks whether the renderer is to be made anew. is_idle: there is nothing to do, so that the golden render is made when the last one is
 * --golden-s old; cancelled: asked whether that is over, then it stops. is_suspect: it is made at once, and to its end, with a new sky. */
enum care_reason renderer_care_look(struct renderer_care *care, bool is_idle, bool is_suspect, renderer_cancelled *cancelled,
				    void *context);

/* Is the last golden render so old that the next one waits for nothing? */
bool renderer_care_is_unproven(const struct renderer_care *care);

/* Makes it anew, a bounded number of times with pauses between, until it proves itself. Nothing may be on its way. false: it does not, and
 * there is none. */
bool renderer_care_rebuild(struct renderer_care *care, enum care_reason reason);

void renderer_care_count_repeat(struct renderer_care *care);

/* Any thread. The device in use: another pointer when it is another device, valid until renderer_care_destroy. */
const struct renderer_info *renderer_care_info(const struct renderer_care *care);
/* Any thread. */
size_t renderer_care_cache_bytes(struct renderer_care *care, enum stage stage);
struct care_counts renderer_care_counts(const struct renderer_care *care);

#endif
