/* Rendered variants held against each other: masks, figures, and what is answered with them. One thread at a time. */
#ifndef STRATUS_SERVER_COMPARISON_H
#define STRATUS_SERVER_COMPARISON_H

#include "renderer/image/difference.h"
#include "renderer/image/image.h"
#include "server/compare_query.h"

/* What is known of one variant in one region. The truth is held against itself: its noise is its own. */
struct comparison_figures {
	struct difference light;
	struct difference_span flip;
};

struct comparison {
	const struct compare_query *query;
	const struct frame *frame[COMPARE_VARIANTS_MAX]; /* each with LAYER_COLOR, scene-linear */
	int width, height;
	double exposure_ev;                         /* of the truth's picture, for all */
	uint8_t *mask;                              /* enum region_bit of each pixel */
	unsigned char *codes[COMPARE_VARIANTS_MAX]; /* developed, 8 bits */
	float *flip[COMPARE_VARIANTS_MAX];          /* NULL of the truth */
	struct comparison_figures figures[COMPARE_VARIANTS_MAX][COMPARE_REGIONS_MAX];
};

/* Compares. frames: of the query's variants, they must outlive the comparison; masked: the one that tells regions, as rendered of
 * mask_scene. cancelled is asked every few milliseconds, of large pictures too. false when cancelled or out of memory. comparison_finish in
 * any case. */
bool comparison_run(const struct compare_query *query, const struct frame *const *frames, const struct frame *masked,
		    renderer_cancelled *cancelled, void *context, struct comparison *comparison);
void comparison_finish(struct comparison *comparison);

/* The figures as JSON text; the caller frees, NULL when out of memory. */
char *comparison_to_json(const struct comparison *comparison);

/* watch: as in image.h. An EXR: layers NAME, NAME.difference, NAME.flip, NAME.standard_error and masks. json: comparison_to_json's. false
 * after a message in `error`. */
bool comparison_to_exr(const struct comparison *comparison, const char *json, const struct image_api *images,
		       const struct image_watch *watch, struct image_buffer *buffer, char *error, size_t error_size);

/* A PNG: the pictures side by side, below them their relative differences, below these FLIP. Likewise. */
bool comparison_to_png(const struct comparison *comparison, const char *json, const struct image_api *images,
		       const struct image_watch *watch, struct image_buffer *buffer, char *error, size_t error_size);

#endif
