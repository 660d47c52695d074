#include "renderer/stages/droplets.h"

#include "renderer/log.h"
#include "renderer/optics/forward.h"

#include <math.h>
#include <stdlib.h>

static void droplets_destroy(void *value)
{
	struct droplets *droplets = value;
	if (!droplets)
		return;
	texture_finish(&droplets->forward_blur);
	texture_finish(&droplets->forward_peak);
	texture_finish(&droplets->phase);
	optics_destroy(droplets->optics);
	free(droplets);
}

/* Angle of a column of the phase tables: uniform in sin(angle/2) in front, in cos(angle/2) behind (shaders/lib/optics.glsl). */
static double column_angle(int column, int width)
{
	const double unit = (double)column / (width - 1);
	return unit < 0.5 ? 2 * asin(unit * M_SQRT2) : 2 * acos(fmin(1, (1 - unit) * M_SQRT2));
}

/* Two rows, P and P_2, as logarithms: linear interpolation of those is far closer on the flanks of the forward peak. */
static bool upload_phase(struct droplets *droplets)
{
	float(*rows)[PHASE_TABLE_WIDTH][4] = calloc(2, sizeof *rows);
	if (!rows)
		return false;
	for (int i = 0; i < PHASE_TABLE_WIDTH; i++) {
		const double angle = column_angle(i, PHASE_TABLE_WIDTH);
		for (int band = 0; band < BAND_COUNT; band++) {
			rows[0][i][band] = (float)log2(fmax(1e-12, optics_phase(droplets->optics, band, angle)));
			rows[1][i][band] = (float)log2(fmax(1e-12, optics_phase2(droplets->optics, band, angle)));
		}
	}
	const bool ok = texture_init(&droplets->phase, PHASE_TABLE_WIDTH, 2, TEXTURE_RGBA32F, 0);
	if (ok)
		texture_upload(&droplets->phase, &rows[0][0][0]);
	free(rows);
	return ok;
}

static bool upload_bands(struct texture *texture, int width, int height, const float *triples)
{
	const size_t texels = (size_t)width * (size_t)height;
	float *quads = calloc(texels, 4 * sizeof *quads);
	if (!quads)
		return false;
	for (size_t i = 0; i < texels; i++)
		for (size_t band = 0; band < BAND_COUNT; band++)
			quads[4 * i + band] = triples[BAND_COUNT * i + band];
	const bool ok = texture_init(texture, width, height, TEXTURE_RGBA32F, 0);
	if (ok)
		texture_upload(texture, quads);
	free(quads);
	return ok;
}

/* The blur, which is smooth, from its even steps in angle to the columns of the phase tables. */
static void resample_blur(const struct forward_tables *tables, float (*rows)[BLUR_ANGLE_COUNT][BAND_COUNT])
{
	for (int i = 0; i < BLUR_ANGLE_COUNT; i++) {
		const double at = column_angle(i, BLUR_ANGLE_COUNT) / M_PI * (BLUR_ANGLE_COUNT - 1);
		const int k = (int)fmin(at, BLUR_ANGLE_COUNT - 2);
		const double share = at - k;
		for (int depth = 0; depth < FORWARD_DEPTH_COUNT; depth++)
			for (int band = 0; band < BAND_COUNT; band++)
				rows[depth][i][band] =
					(float)((1 - share) * tables->blur[depth][k][band] + share * tables->blur[depth][k + 1][band]);
	}
}

static bool upload_forward(struct droplets *droplets)
{
	struct forward_tables *tables = malloc(sizeof *tables);
	float(*blur)[BLUR_ANGLE_COUNT][BAND_COUNT] = malloc(sizeof tables->blur);
	bool ok = false;
	if (!tables || !blur)
		goto end;
	forward_tables_compute(droplets->optics, tables);
	resample_blur(tables, blur);
	ok = upload_bands(&droplets->forward_peak, FORWARD_ANGLE_COUNT, FORWARD_DEPTH_COUNT, &tables->peak[0][0][0]) &&
	     upload_bands(&droplets->forward_blur, BLUR_ANGLE_COUNT, FORWARD_DEPTH_COUNT, &blur[0][0][0]);
end:
	free(blur);
	free(tables);
	return ok;
}

static struct droplets *droplets_create(const struct stage_context *context, const struct scene *scene)
{
	struct droplets *droplets = calloc(1, sizeof *droplets);
	if (!droplets)
		return NULL;
	droplets->optics = optics_create(context->kernel, &scene->dsd, scene->model.optics);
	if (!droplets->optics || !upload_phase(droplets) || !upload_forward(droplets)) {
		log_error("optics: out of memory");
		droplets_destroy(droplets);
		return NULL;
	}
	return droplets;
}

static void add_droplets(struct cache_key *key, const struct scene *scene)
{
	cache_key_add(key, scene->dsd.n0_per_cm3);
	cache_key_add(key, scene->dsd.gamma);
	cache_key_add(key, scene->dsd.effective_radius_um);
	cache_key_add(key, scene->model.optics);
}

const struct droplets *droplets_get(struct stage_context *context, const struct scene *scene)
{
	struct cache_key key = cache_key_make("droplets");
	add_droplets(&key, scene);
	struct droplets *droplets = cache_find(context->cache, &key);
	if (!droplets) {
		context->reused = false;
		droplets = droplets_create(context, scene);
		if (!droplets)
			return NULL;
		const size_t bytes = texture_bytes(&droplets->phase) + texture_bytes(&droplets->forward_peak) +
				     texture_bytes(&droplets->forward_blur) +
				     (size_t)(droplets->optics->angle_count * 8 + droplets->optics->moment_count * 9) * sizeof(double);
		if (!cache_keep(context->cache, &key, droplets, bytes, droplets_destroy))
			return NULL;
	}
	const struct optics *optics = droplets->optics;
	for (int band = 0; band < BAND_COUNT; band++) {
		context->block.extinction[band] = (float)optics->extinction_per_m[band];
		context->block.extinction_modified[band] =
			(float)(optics->extinction_per_m[band] * (1 - optics->forward_peak_fraction[band]));
	}
	return droplets;
}
