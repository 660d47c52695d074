/* Comparisons as image files. */
#include "server/comparison.h"

#include "renderer/image/false_colour.h"
#include "renderer/image/regions.h"
#include "server/scene_canonical.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static size_t pixel_count(const struct comparison *comparison)
{
	return (size_t)comparison->width * (size_t)comparison->height;
}

static const struct scene *truth_scene(const struct comparison *comparison)
{
	return &comparison->query->variant[comparison->query->truth].input.scene;
}

/* --- EXR
 * ---------------------------------------------------------------------------------------------------------------------------------- */

/* Of each variant: picture, difference and standard error with three channels each, and FLIP; and three masks. */
enum { PLANES_MAX = 10 * COMPARE_VARIANTS_MAX + 3, PLANE_NAME_SIZE = COMPARE_NAME_SIZE + 32 };

struct plane_list {
	struct image_plane plane[PLANES_MAX];
	char name[PLANES_MAX][PLANE_NAME_SIZE];
	size_t count;
};

__attribute__((format(printf, 4, 5))) static void add_plane(struct plane_list *list, const float *values, int stride, const char *format,
							    ...)
{
	struct image_plane *plane = &list->plane[list->count];
	char *name = list->name[list->count++];
	va_list args;
	va_start(args, format);
	vsnprintf(name, PLANE_NAME_SIZE, format, args);
	va_end(args);
	*plane = (struct image_plane){.name = name, .values = values, .stride = stride};
}

/* layer: with a dot in front, or "" for the picture itself; NULL values are left out. */
static void add_colour(struct plane_list *list, const float *values, const char *variant, const char *layer)
{
	for (int c = 0; values && c < 3; c++)
		add_plane(list, values + c, 3, "%s%s.%c", variant, layer, "RGB"[c]);
}

static void fill_difference(const struct comparison *comparison, int variant, float *difference)
{
	const float *picture = frame_layer(comparison->frame[variant], LAYER_COLOR);
	const float *truth = frame_layer(comparison->frame[comparison->query->truth], LAYER_COLOR);
	for (size_t i = 0; i < 3 * pixel_count(comparison); i++)
		difference[i] = picture[i] - truth[i];
}

static void fill_mask(const struct comparison *comparison, uint8_t bit, float *mask)
{
	for (size_t i = 0; i < pixel_count(comparison); i++)
		mask[i] = comparison->mask[i] & bit ? 1 : 0;
}

/* `own` has room for three differences and three masks. */
static void list_planes(const struct comparison *comparison, float *own, struct plane_list *list)
{
	static const struct {
		const char *name;
		uint8_t bit;
	} masks[] = {{"mask.cloud", REGION_CLOUD}, {"mask.sky", REGION_SKY}, {"mask.ground", REGION_GROUND}};
	const struct compare_query *query = comparison->query;
	for (int i = 0; i < query->variant_count; i++) {
		const char *name = query->variant[i].name;
		add_colour(list, frame_layer(comparison->frame[i], LAYER_COLOR), name, "");
		add_colour(list, frame_layer(comparison->frame[i], LAYER_STANDARD_ERROR), name, ".standard_error");
		if (i == query->truth)
			continue;
		fill_difference(comparison, i, own);
		add_colour(list, own, name, ".difference");
		add_plane(list, comparison->flip[i], 1, "%s.flip.Y", name);
		own += 3 * pixel_count(comparison);
	}
	for (size_t i = 0; query->has_masks && i < sizeof masks / sizeof *masks; i++, own += pixel_count(comparison)) {
		fill_mask(comparison, masks[i].bit, own);
		add_plane(list, own, 1, "%s.Y", masks[i].name);
	}
}

/* metadata->scene_json: the truth's, whose camera the file has. */
static struct image_metadata describe(const struct comparison *comparison, const char *json, char **canonical)
{
	*canonical = scene_canonical(truth_scene(comparison));
	return (struct image_metadata){
		.scene_json = *canonical ? *canonical : "", .software = "stratus " RENDERER_VERSION, .comparison = json};
}

bool comparison_to_exr(const struct comparison *comparison, const char *json, const struct image_api *images,
		       const struct image_watch *watch, struct image_buffer *buffer, char *error, size_t error_size)
{
	char *canonical;
	const struct image_metadata metadata = describe(comparison, json, &canonical);
	float *own = malloc(pixel_count(comparison) * (3 * (COMPARE_VARIANTS_MAX - 1) + 3) * sizeof *own);
	struct plane_list *list = calloc(1, sizeof *list);
	bool ok = own && list && canonical;
	snprintf(error, error_size, "out of memory");
	if (ok) {
		list_planes(comparison, own, list);
		const struct image_planes planes = {comparison->width, comparison->height, list->plane, list->count};
		ok = images->encode_planes(&planes, truth_scene(comparison), &metadata, watch, buffer, error, error_size);
	}
	free(canonical);
	free(list);
	free(own);
	return ok;
}

/* --- PNG
 * ---------------------------------------------------------------------------------------------------------------------------------- */

/* A picture of `columns` x 3 cells, each as large as the pictures compared. */
struct sheet {
	int width, height, columns; /* of a cell */
	unsigned char *codes;
};

/* Relative difference that the strongest colour stands for. */
static const float difference_shown = 0.5f;

static unsigned char *sheet_pixel(const struct sheet *sheet, int column, int row, int x, int y)
{
	const size_t line = (size_t)row * (size_t)sheet->height + (size_t)y;
	return sheet->codes + 3 * (line * (size_t)(sheet->columns * sheet->width) + (size_t)column * (size_t)sheet->width + (size_t)x);
}

static float luminance_of(const float *rgb)
{
	return 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
}

static void draw_picture(const struct comparison *comparison, int variant, const struct sheet *sheet)
{
	for (int y = 0; y < sheet->height; y++)
		memcpy(sheet_pixel(sheet, variant, 0, 0, y), comparison->codes[variant] + 3 * (size_t)y * (size_t)sheet->width,
		       3 * (size_t)sheet->width);
}

/* Black on both sides: white, as no difference. */
static float relative_difference(const float *picture, const float *truth)
{
	const float light = luminance_of(truth), difference = luminance_of(picture) - light;
	return difference == 0 ? 0 : light > 0 ? difference / light : copysignf(1, difference);
}

static void draw_maps(const struct comparison *comparison, int variant, const struct sheet *sheet)
{
	const float *picture = frame_layer(comparison->frame[variant], LAYER_COLOR);
	const float *truth = frame_layer(comparison->frame[comparison->query->truth], LAYER_COLOR);
	const float *flip = comparison->flip[variant];
	for (int y = 0; y < sheet->height; y++)
		for (int x = 0; x < sheet->width; x++, picture += 3, truth += 3, flip++) {
			false_colour_diverging(relative_difference(picture, truth) / difference_shown,
					       sheet_pixel(sheet, variant, 1, x, y));
			false_colour_magma(*flip, sheet_pixel(sheet, variant, 2, x, y));
		}
}

/* Where the truth has no maps: the scales of the others, from left to right, in the middle of dark grey. */
static void draw_scales(int truth, const struct sheet *sheet)
{
	const int low = sheet->height * 7 / 16, high = sheet->height * 9 / 16;
	for (int y = 0; y < sheet->height; y++)
		for (int x = 0; x < sheet->width; x++) {
			unsigned char *upper = sheet_pixel(sheet, truth, 1, x, y), *lower = sheet_pixel(sheet, truth, 2, x, y);
			const float at = ((float)x + 0.5f) / (float)sheet->width;
			memset(upper, 48, 3);
			memset(lower, 48, 3);
			if (y >= low && y < high) {
				false_colour_diverging(2 * at - 1, upper);
				false_colour_magma(at, lower);
			}
		}
}

static void draw_sheet(const struct comparison *comparison, const struct sheet *sheet)
{
	for (int i = 0; i < sheet->columns; i++) {
		draw_picture(comparison, i, sheet);
		if (i == comparison->query->truth)
			draw_scales(i, sheet);
		else
			draw_maps(comparison, i, sheet);
	}
}

bool comparison_to_png(const struct comparison *comparison, const char *json, const struct image_api *images,
		       const struct image_watch *watch, struct image_buffer *buffer, char *error, size_t error_size)
{
	char *canonical;
	const struct image_metadata metadata = describe(comparison, json, &canonical);
	struct sheet sheet = {comparison->width, comparison->height, comparison->query->variant_count, NULL};
	struct frame frame = {.width = sheet.columns * sheet.width,
			      .height = 3 * sheet.height,
			      .type = PIXEL_U8,
			      .channels = 3,
			      .layer_count = 1,
			      .layer = {LAYER_COLOR},
			      .exposure_ev = comparison->exposure_ev};
	struct scene scene = *truth_scene(comparison);
	scene.output.format = IMAGE_PNG;
	scene.output.bits = 8;
	frame.bytes = 3 * (size_t)frame.width * (size_t)frame.height;
	frame.pixels = sheet.codes = malloc(frame.bytes);
	bool ok = canonical && sheet.codes;
	snprintf(error, error_size, "out of memory");
	if (ok) {
		draw_sheet(comparison, &sheet);
		ok = images->encode(&frame, &scene, &metadata, watch, buffer, error, error_size);
	}
	free(canonical);
	frame_finish(&frame);
	return ok;
}
