#include "server/comparison.h"

#include "renderer/image/develop.h"
#include "renderer/image/flip.h"
#include "renderer/image/regions.h"
#include "server/scene_canonical.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A bit of the mask beside enum region_bit: inside of the rectangle that is measured. */
enum { IN_RECTANGLE = 128 };

static const struct scene *truth_scene(const struct compare_query *query)
{
	return &query->variant[query->truth].input.scene;
}

/* --- figures
 * ------------------------------------------------------------------------------------------------------------------------------ */

static void mark_rectangle(struct comparison *comparison, const struct compare_region *region)
{
	const size_t width = (size_t)comparison->width;
	for (size_t i = 0; i < width * (size_t)comparison->height; i++) {
		const int x = (int)(i % width), y = (int)(i / width);
		const bool inside = x >= region->x && x < region->x + region->width && y >= region->y && y < region->y + region->height;
		comparison->mask[i] &= (uint8_t)~IN_RECTANGLE;
		if (inside && comparison->mask[i])
			comparison->mask[i] |= IN_RECTANGLE;
	}
}

static void measure(struct comparison *comparison, int variant, const struct compare_region *region, struct comparison_figures *figures)
{
	const int truth = comparison->query->truth;
	const struct frame *frame = comparison->frame[variant], *true_frame = comparison->frame[truth];
	const size_t count = (size_t)comparison->width * (size_t)comparison->height;
	const uint8_t bits = region->is_rectangle ? IN_RECTANGLE : region->bits;
	const struct difference_pair pair = {
		.picture = frame_layer(frame, LAYER_COLOR),
		.truth = frame_layer(true_frame, LAYER_COLOR),
		.picture_error = variant == truth ? NULL : frame_layer(frame, LAYER_STANDARD_ERROR),
		.truth_error = frame_layer(true_frame, LAYER_STANDARD_ERROR),
	};
	figures->light = difference_measure(&pair, comparison->mask, bits, count);
	if (comparison->flip[variant])
		figures->flip = difference_span(comparison->flip[variant], comparison->mask, bits, count);
}

static bool measure_all(struct comparison *comparison, renderer_cancelled *cancelled, void *context)
{
	const struct compare_query *query = comparison->query;
	for (int r = 0; r < query->region_count; r++) {
		if (query->region[r].is_rectangle)
			mark_rectangle(comparison, &query->region[r]);
		for (int v = 0; v < query->variant_count; v++) {
			if (cancelled(context))
				return false;
			measure(comparison, v, &query->region[r], &comparison->figures[v][r]);
		}
	}
	return true;
}

/* --- pictures
 * ----------------------------------------------------------------------------------------------------------------------------- */

/* Between two questions whether to go on: some 20 milliseconds. */
enum { ASK_PIXELS = 1 << 17 };

static bool develop(struct comparison *comparison, int variant, renderer_cancelled *cancelled, void *context)
{
	const size_t count = (size_t)comparison->width * (size_t)comparison->height;
	const float *light = frame_layer(comparison->frame[variant], LAYER_COLOR);
	unsigned char *codes = comparison->codes[variant] = malloc(3 * count);
	for (size_t first = 0; codes && first < count; first += ASK_PIXELS) {
		const size_t some = count - first < ASK_PIXELS ? count - first : ASK_PIXELS;
		if (cancelled(context))
			return false;
		develop_picture(light + 3 * first, some, comparison->exposure_ev, truth_scene(comparison->query)->output.tone,
				codes + 3 * first);
	}
	return codes;
}

static bool look_at(const struct comparison *comparison, int variant, renderer_cancelled *cancelled, void *context,
		    struct flip_picture *seen)
{
	return flip_picture_init(seen, comparison->codes[variant], comparison->width, comparison->height, FLIP_PIXELS_PER_DEGREE, cancelled,
				 context);
}

static bool flip_one(struct comparison *comparison, int variant, const struct flip_picture *truth, renderer_cancelled *cancelled,
		     void *context)
{
	const size_t count = (size_t)comparison->width * (size_t)comparison->height;
	struct flip_picture seen;
	float *map = comparison->flip[variant] = malloc(count * sizeof *map);
	bool ok = look_at(comparison, variant, cancelled, context, &seen) && map;
	for (size_t first = 0; ok && first < count; first += ASK_PIXELS) {
		ok = !cancelled(context);
		if (ok)
			flip_compare(truth, &seen, first, count - first < ASK_PIXELS ? count : first + ASK_PIXELS, map);
	}
	flip_picture_finish(&seen);
	return ok;
}

static bool flip_all(struct comparison *comparison, renderer_cancelled *cancelled, void *context)
{
	const struct compare_query *query = comparison->query;
	struct flip_picture truth;
	bool ok = look_at(comparison, query->truth, cancelled, context, &truth);
	for (int i = 0; ok && i < query->variant_count; i++)
		ok = i == query->truth || flip_one(comparison, i, &truth, cancelled, context);
	flip_picture_finish(&truth);
	return ok;
}

bool comparison_run(const struct compare_query *query, const struct frame *const *frames, const struct frame *masked,
		    renderer_cancelled *cancelled, void *context, struct comparison *comparison)
{
	const struct frame *truth = frames[query->truth];
	*comparison = (struct comparison){.query = query, .width = truth->width, .height = truth->height};
	comparison->exposure_ev = truth->exposure_ev;
	if (cancelled(context))
		return false;
	comparison->mask = malloc((size_t)truth->width * (size_t)truth->height);
	if (!comparison->mask)
		return false;
	regions_find(truth_scene(query), masked, comparison->mask);
	for (int i = 0; i < query->variant_count; i++) {
		comparison->frame[i] = frames[i];
		if (!develop(comparison, i, cancelled, context))
			return false;
	}
	return flip_all(comparison, cancelled, context) && measure_all(comparison, cancelled, context);
}

void comparison_finish(struct comparison *comparison)
{
	for (int i = 0; i < COMPARE_VARIANTS_MAX; i++) {
		free(comparison->codes[i]);
		free(comparison->flip[i]);
	}
	free(comparison->mask);
	*comparison = (struct comparison){0};
}

/* --- JSON
 * ---------------------------------------------------------------------------------------------------------------------------------- */

/* What has no value, in a region without pixels or light, is null. */
static json_t *number(double value)
{
	return isfinite(value) ? json_real(value) : json_null();
}

static json_t *region_to_json(const struct comparison *comparison, int index)
{
	const struct compare_region *region = &comparison->query->region[index];
	const struct difference *light = &comparison->figures[comparison->query->truth][index].light;
	json_t *object =
		json_pack("{s:s, s:I, s:o}", "name", region->name, "pixels", (json_int_t)light->pixels, "mean", number(light->truth_mean));
	if (region->is_rectangle)
		json_object_set_new(object, "rectangle", json_pack("[i, i, i, i]", region->x, region->y, region->width, region->height));
	return object;
}

static json_t *figures_to_json(const struct comparison_figures *figures, bool is_truth)
{
	const struct difference *light = &figures->light;
	if (is_truth)
		return json_pack("{s:o}", "noise", number(light->noise));
	return json_pack("{s:o, s:o, s:[o, o, o], s:o, s:o, s:o, s:o, s:{s:o, s:o}}", "bias", number(light->bias), "bias_standard_error",
			 number(light->bias_standard_error), "channel_bias", number(light->channel_bias[0]), number(light->channel_bias[1]),
			 number(light->channel_bias[2]), "rms", number(light->rms), "noise", number(light->noise), "noise_corrected_rms",
			 number(light->noise_corrected_rms), "noise_corrected_rms_standard_error",
			 number(light->noise_corrected_rms_standard_error), "flip", "mean", number(figures->flip.mean), "max",
			 number(figures->flip.largest));
}

/* The GET that makes the picture that was compared. */
static json_t *location_of(const struct scene *scene)
{
	char *query = scene_canonical_query(scene);
	json_t *location = query ? json_sprintf("/v1/render?%s", query) : NULL;
	free(query);
	return location;
}

static json_t *variant_to_json(const struct comparison *comparison, int index)
{
	const struct compare_query *query = comparison->query;
	const struct compare_variant *variant = &query->variant[index];
	json_t *regions = json_object();
	for (int r = 0; r < query->region_count; r++)
		json_object_set_new(regions, query->region[r].name, figures_to_json(&comparison->figures[index][r], index == query->truth));
	json_t *object = json_pack("{s:s, s:o}", "name", variant->name, "location", location_of(&variant->input.scene));
	if (comparison->frame[index]->samples > 0) {
		json_object_set_new(object, "samples", json_integer(comparison->frame[index]->samples));
		json_object_set_new(object, "partial", json_boolean(comparison->frame[index]->partial));
	}
	json_object_set_new(object, "regions", regions);
	return object;
}

char *comparison_to_json(const struct comparison *comparison)
{
	const struct compare_query *query = comparison->query;
	json_t *regions = json_array(), *variants = json_array();
	for (int r = 0; r < query->region_count; r++)
		json_array_append_new(regions, region_to_json(comparison, r));
	for (int v = 0; v < query->variant_count; v++)
		json_array_append_new(variants, variant_to_json(comparison, v));
	json_t *root = json_pack("{s:i, s:i, s:f, s:s, s:o, s:o}", "width", comparison->width, "height", comparison->height, "exposure_ev",
				 comparison->exposure_ev, "reference", query->variant[query->truth].name, "regions", regions, "variants",
				 variants);
	char *text = root ? json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(6)) : NULL;
	json_decref(root);
	return text;
}
