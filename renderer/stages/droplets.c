#include "renderer/stages/droplets.h"

#include "renderer/log.h"
#include "renderer/optics/slab_residual.h"

#include <math.h>
#include <stdlib.h>

enum { WIDTH = EVENT_TABLE_WIDTH, DEPTHS = EVENT_TABLE_DEPTHS, PARTS = 4 };

_Static_assert((int)DEPTHS == (int)FORWARD_DEPTH_COUNT && (int)DEPTHS == (int)SLAB_RESIDUAL_DEPTH_COUNT, "one depth a row");
_Static_assert((int)WIDTH >= (int)FORWARD_ANGLE_COUNT && (int)WIDTH >= (int)BLUR_ANGLE_COUNT, "a part fits into the width");

/* RGBA of one depth of one part. */
typedef float event_row[WIDTH][4];

static void droplets_destroy(void *value)
{
	struct droplets *droplets = value;
	if (!droplets)
		return;
	texture_finish(&droplets->events);
	texture_finish(&droplets->phase);
	free(droplets);
}

static bool upload_phase(struct droplets *droplets)
{
	float(*rows)[DROPLET_PHASE_COLUMNS][4] = calloc(2, sizeof *rows);
	if (!rows)
		return false;
	for (int row = 0; row < 2; row++)
		for (int i = 0; i < DROPLET_PHASE_COLUMNS; i++)
			for (int band = 0; band < BAND_COUNT; band++)
				rows[row][i][band] = droplets->tables->phase[row][i][band];
	const bool ok = texture_init(&droplets->phase, DROPLET_PHASE_COLUMNS, 2, TEXTURE_RGBA32F, 0);
	if (ok)
		texture_upload(&droplets->phase, &rows[0][0][0]);
	free(rows);
	return ok;
}

static void fill_peak(const struct forward_tables *forward, event_row *rows)
{
	for (int depth = 0; depth < DEPTHS; depth++)
		for (int i = 0; i < WIDTH; i++) {
			const int k = i < FORWARD_ANGLE_COUNT ? i : FORWARD_ANGLE_COUNT - 1;
			for (int band = 0; band < BAND_COUNT; band++)
				rows[depth][i][band] = forward->peak[depth][k][band];
		}
}

/* The blur, which is smooth, from its even steps in angle to columns like those of the phase tables. */
static void fill_blur(const struct forward_tables *forward, event_row *rows)
{
	for (int i = 0; i < BLUR_ANGLE_COUNT; i++) {
		const double at = droplet_phase_angle(i, BLUR_ANGLE_COUNT) / M_PI * (BLUR_ANGLE_COUNT - 1);
		const int k = (int)fmin(at, BLUR_ANGLE_COUNT - 2);
		const double share = at - k;
		for (int depth = 0; depth < DEPTHS; depth++)
			for (int band = 0; band < BAND_COUNT; band++)
				rows[depth][i][band] =
					(float)((1 - share) * forward->blur[depth][k][band] + share * forward->blur[depth][k + 1][band]);
	}
}

/* Columns dense at both ends: half the sine, respectively cosine, of half the angle as a square (solved_residual_column in
 * shaders/lib/slab_solved.glsl). */
static double residual_angle(int column)
{
	const double unit = 2.0 * column / (WIDTH - 1);
	return unit < 1 ? 2 * asin(unit * unit * M_SQRT1_2) : 2 * acos((2 - unit) * (2 - unit) * M_SQRT1_2);
}

/* Scaled optical thickness of a band over that at 550 nm. */
static double depth_ratio(const struct droplet_tables *tables, int band)
{
	const struct slab_band *own = &tables->slab->band[band], *middle = &tables->slab->band[1];
	return tables->optics->extinction_per_m[band] * (1 - own->truncated) /
	       (tables->optics->extinction_per_m[1] * (1 - middle->truncated));
}

/* Rows stand for depths at 550 nm: one look-up serves all bands. */
static void fill_residual(const struct droplet_tables *tables, enum slab_side side, event_row *rows)
{
	for (int band = 0; band < BAND_COUNT; band++) {
		double at[DEPTHS];
		for (int depth = 0; depth < DEPTHS; depth++)
			at[depth] = slab_residual_depth_index(slab_residual_depth(depth) * depth_ratio(tables, band));
		for (int i = 0; i < WIDTH; i++) {
			float column[SLAB_RESIDUAL_DEPTH_COUNT];
			slab_residual_column(&tables->slab->band[band], side, residual_angle(i), column);
			for (int depth = 0; depth < DEPTHS; depth++) {
				const int k = (int)fmin(at[depth], SLAB_RESIDUAL_DEPTH_COUNT - 2);
				rows[depth][i][band] = column[k] + ((float)at[depth] - (float)k) * (column[k + 1] - column[k]);
			}
		}
	}
}

static bool upload_events(struct droplets *droplets)
{
	event_row *rows = calloc(PARTS * DEPTHS, sizeof *rows);
	if (!rows)
		return false;
	fill_peak(droplets->tables->forward, rows);
	fill_blur(droplets->tables->forward, rows + DEPTHS);
	fill_residual(droplets->tables, SLAB_REFLECTED, rows + 2 * DEPTHS);
	fill_residual(droplets->tables, SLAB_TRANSMITTED, rows + 3 * DEPTHS);
	const bool ok = texture_init(&droplets->events, WIDTH, PARTS * DEPTHS, TEXTURE_RGBA32F, 0);
	if (ok)
		texture_upload(&droplets->events, &rows[0][0][0]);
	free(rows);
	return ok;
}

static struct droplets *droplets_create(const struct stage_context *context)
{
	struct droplets *droplets = calloc(1, sizeof *droplets);
	if (!droplets)
		return NULL;
	droplets->tables = context->tables;
	if (!upload_phase(droplets) || !upload_events(droplets)) {
		log_error("optics: out of memory");
		droplets_destroy(droplets);
		return NULL;
	}
	return droplets;
}

void droplets_key_add(struct cache_key *key, const struct scene *scene)
{
	cache_key_add(key, scene->dsd.n0_per_cm3);
	cache_key_add(key, scene->dsd.gamma);
	cache_key_add(key, scene->dsd.effective_radius_um);
	cache_key_add(key, scene->model.optics);
}

static void fill_block(struct scene_block *block, const struct scene *scene, const struct droplet_tables *tables)
{
	const struct optics *optics = tables->optics;
	const bool solved = scene->model.shading == SHADING_SOLVED;
	for (int band = 0; band < BAND_COUNT; band++) {
		const double kappa = optics->extinction_per_m[band], modified = kappa * (1 - optics->forward_peak_fraction[band]);
		block->extinction[band] = (float)kappa;
		block->extinction_modified[band] = (float)modified;
		block->extinction_scaled[band] = (float)(solved ? kappa * (1 - tables->slab->band[band].truncated) : modified);
	}
	block->extinction_scaled[3] = (float)tables->slab->band[1].extrapolation;
}

void droplets_release(struct stage_context *context)
{
	if (context->tables)
		droplet_store_release(context->droplets, context->tables);
	context->tables = NULL;
}

const struct droplets *droplets_get(struct stage_context *context, const struct scene *scene)
{
	enum droplet_source source;
	droplets_release(context);
	context->tables = droplet_store_get(context->droplets, &scene->dsd, scene->model.optics, &source);
	if (!context->tables)
		return NULL;
	context->reused = context->reused && source == DROPLETS_FROM_MEMORY;
	struct cache_key key = cache_key_make("droplets");
	droplets_key_add(&key, scene);
	struct droplets *droplets = cache_find(context->cache, &key);
	if (!droplets) {
		context->reused = false;
		droplets = droplets_create(context);
		if (!droplets || !cache_keep(context->cache, &key, droplets,
					     texture_bytes(&droplets->phase) + texture_bytes(&droplets->events), droplets_destroy))
			return NULL;
	}
	droplets->tables = context->tables;
	fill_block(&context->block, scene, droplets->tables);
	return droplets;
}
