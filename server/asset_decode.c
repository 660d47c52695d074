#include "server/asset_decode.h"

#include "renderer/resample.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* --- one pixel -------------------------------------------------------------------------------------------------------------------- */

/* Codes of 8 and of 16 bits are whole multiples of this. */
enum { CODES = 65536 };
static float linear_of_code[CODES];

/* IEC 61966-2-1. */
static void fill_linear_of_code(void)
{
	for (int i = 0; i < CODES; i++) {
		const double v = i / (CODES - 1.0);
		linear_of_code[i] = (float)(v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4));
	}
}

static float linear_of(float srgb)
{
	return linear_of_code[(int)(fminf(fmaxf(srgb, 0), 1) * (CODES - 1) + 0.5f)];
}

/* How the pixels of a picture are to be read. */
struct reading {
	enum image_format format;
	int channels; /* as image_rows has them */
};

static float alpha_of(const struct reading *reading, const float *pixel)
{
	const bool has_alpha = reading->channels == 2 || reading->channels == 4;
	return has_alpha && reading->format == IMAGE_PNG ? pixel[reading->channels - 1] : 1;
}

static void read_thickness(const struct reading *reading, const float *pixel, float *thickness)
{
	float value = pixel[0];
	/* Rec.709 luminance; grey that is stored as colour stays exactly what it is. */
	if (reading->channels >= 3 && (pixel[1] != value || pixel[2] != value))
		value = 0.2126f * pixel[0] + 0.7152f * pixel[1] + 0.0722f * pixel[2];
	*thickness = value * alpha_of(reading, pixel);
}

static void read_albedo(const struct reading *reading, const float *pixel, float albedo[3])
{
	const float alpha = alpha_of(reading, pixel);
	for (int band = 0; band < 3; band++) {
		const float value = pixel[reading->channels >= 3 ? band : 0];
		albedo[band] = alpha * (reading->format == IMAGE_PNG ? linear_of(value) : value);
	}
}

static bool open_picture(int fd, uint64_t size, struct picture_file *file, char *error, size_t error_size)
{
	static pthread_once_t once = PTHREAD_ONCE_INIT;
	pthread_once(&once, fill_linear_of_code);
	return picture_file_read(fd, size, file, error, error_size);
}

/* --- looking through -------------------------------------------------------------------------------------------------------------- */

struct examination {
	int width;
	struct asset_facts *facts;
	bool finite;
	double sum[3];
};

static void extend(struct asset_facts *facts, enum asset_use use, float value)
{
	facts->lowest[use] = fminf(facts->lowest[use], value);
	facts->highest[use] = fmaxf(facts->highest[use], value);
}

static bool examine_rows(void *context, const struct image_rows *rows)
{
	struct examination *examination = context;
	struct asset_facts *facts = examination->facts;
	const struct reading reading = {facts->format, rows->channels};
	const size_t count = (size_t)rows->count * (size_t)examination->width;
	for (size_t i = 0; i < count; i++) {
		float thickness, albedo[3];
		read_thickness(&reading, rows->values + i * (size_t)rows->channels, &thickness);
		read_albedo(&reading, rows->values + i * (size_t)rows->channels, albedo);
		extend(facts, ASSET_THICKNESS, thickness);
		for (int band = 0; band < 3; band++) {
			extend(facts, ASSET_ALBEDO, albedo[band]);
			examination->finite &= isfinite(albedo[band]);
			examination->sum[band] += albedo[band];
		}
	}
	return examination->finite;
}

/* Of a library's words those about the picture: behind who says so and of which file, before a second line and the last full stop. */
static const char *matter_of(char *reason)
{
	static const char *const speakers[] = {
		"PNG read error: ", "OpenEXR exception: ", "Failed OpenEXR read: ", "image file \"picture.exr\". "};
	const char *matter = reason;
	reason[strcspn(reason, "\n")] = '\0';
	for (size_t i = strlen(reason); i > 0 && strchr(". ", reason[i - 1]); i--)
		reason[i - 1] = '\0';
	for (size_t i = 0; i < sizeof speakers / sizeof *speakers; i++) {
		const char *speaker = strstr(matter, speakers[i]);
		if (speaker)
			matter = speaker + strlen(speakers[i]);
	}
	return matter;
}

bool asset_examine(const struct image_api *images, int fd, uint64_t size, struct asset_facts *facts, char *error, size_t error_size)
{
	struct picture_file file;
	struct examination examination = {.facts = facts, .finite = true};
	char reason[192];
	bool ok = false;
	*facts = (struct asset_facts){.lowest = {INFINITY, INFINITY}, .highest = {-INFINITY, -INFINITY}};
	if (!open_picture(fd, size, &file, error, error_size))
		goto end;
	facts->format = file.format;
	facts->width = file.width;
	facts->height = file.height;
	examination.width = file.width;
	ok = images->decode(fd, &file, examine_rows, &examination, reason, sizeof reason);
	if (!examination.finite)
		snprintf(error, error_size, "holds a value that is not finite");
	else if (!ok)
		snprintf(error, error_size, "cannot be read: %s", matter_of(reason));
	for (int band = 0; band < 3; band++)
		facts->mean_albedo[band] = (float)(examination.sum[band] / ((double)file.width * file.height));
end:
	picture_file_finish(&file);
	return ok;
}

/* --- reading ---------------------------------------------------------------------------------------------------------------------- */

struct decoding {
	enum image_format format;
	int width;
	struct scene_map *map;
	float *row; /* of the picture, as the map has its values */
	struct resample_reducer reducer;
};

static bool decode_rows(void *context, const struct image_rows *rows)
{
	struct decoding *decoding = context;
	const struct reading reading = {decoding->format, rows->channels};
	const float *pixel = rows->values;
	for (int y = 0; y < rows->count; y++) {
		for (int x = 0; x < decoding->width; x++, pixel += rows->channels) {
			if (decoding->map->channels == 1)
				read_thickness(&reading, pixel, &decoding->row[x]);
			else
				read_albedo(&reading, pixel, &decoding->row[3 * (size_t)x]);
		}
		resample_reducer_add(&decoding->reducer, decoding->row);
	}
	return true;
}

struct scene_map *asset_decode(const struct image_api *images, int fd, uint64_t size, enum asset_use use, int side,
			       const unsigned char hash[static SCENE_MAP_HASH_BYTES], char *error, size_t error_size)
{
	struct picture_file file;
	struct decoding decoding = {0};
	const int channels = use == ASSET_THICKNESS ? 1 : 3;
	bool ok = false;
	if (!open_picture(fd, size, &file, error, error_size))
		goto end;
	const int width = file.width < side ? file.width : side, height = file.height < side ? file.height : side;
	snprintf(error, error_size, "out of memory");
	decoding.format = file.format;
	decoding.width = file.width;
	decoding.map = scene_map_create(width, height, channels, hash);
	decoding.row = malloc((size_t)file.width * (size_t)channels * sizeof *decoding.row);
	ok = decoding.map && decoding.row &&
	     resample_reducer_init(&decoding.reducer, file.width, file.height, channels, width, height, decoding.map->values) &&
	     images->decode(fd, &file, decode_rows, &decoding, error, error_size);
	resample_reducer_finish(&decoding.reducer);
	free(decoding.row);
	if (ok) {
		scene_map_seal(decoding.map);
	} else {
		scene_map_release(decoding.map);
		decoding.map = NULL;
	}
end:
	picture_file_finish(&file);
	return decoding.map;
}
