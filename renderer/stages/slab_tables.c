/* Rows of the slab over thickness for one sun elevation, of either shading. */
#include "renderer/stages/slab_tables.h"

#include "renderer/droplet_store.h"
#include "renderer/log.h"
#include "renderer/optics/paper_radiance.h"

#include <math.h>
#include <stdlib.h>

enum { ROW_DIFFUSE_T, ROW_DOUBLE_T, ROW_DIFFUSE_R, ROW_DOUBLE_R, ROW_DIRECTIONAL_T, ROW_SPHERICAL_R };

enum { COLUMNS = SLAB_TABLE_WIDTH };

typedef float slab_row[COLUMNS][4];

/* A table in work. */
struct rows {
	const struct scene *scene;
	const struct optics *optics;
	const struct slab_solution *slab;
	struct paper_fit_table fit; /* in the paper's shading */
	double mu_l;
	double thickness_m[COLUMNS];
	slab_row *row; /* [SLAB_TABLE_HEIGHT] */
};

static double modified_share(const struct optics *optics, int band)
{
	return 1 - optics->forward_peak_fraction[band];
}

/* Share of diffuse light that goes through, of that which meets droplets. */
static double share_of(double transmittance, double slant_depth)
{
	return fmin(fmax((transmittance - exp(-slant_depth)) / -expm1(-slant_depth), 0), 1);
}

/* Cosine of a view's row, and an optical thickness that is not 0, where the share has its limit. */
static double row_cosine(int view)
{
	return fmax(cos(slab_slice_zenith(view)), 0.01);
}

static double row_depth(double tau)
{
	return fmax(tau, 1e-6);
}

/* --- the paper's shading -------------------------------------------------------------------------------------------------------- */

static void paper_fill_columns(const struct rows *rows, int band)
{
	const double kappa = rows->optics->extinction_per_m[band];
	struct paper_shape shape;
	paper_shape_init(&shape, rows->optics, band, 2, rows->mu_l);
	for (int i = 0; i < COLUMNS; i++) {
		const double tau = kappa * rows->thickness_m[i], modified = modified_share(rows->optics, band) * tau;
		const struct paper_orders orders = paper_layer_orders(&rows->fit, rows->optics, band, tau, rows->mu_l);
		rows->row[ROW_DIFFUSE_T][i][band] = (float)orders.t[3];
		rows->row[ROW_DOUBLE_T][i][band] = (float)paper_shape_scale(&shape, SLAB_TRANSMITTED, modified, &orders);
		rows->row[ROW_DIFFUSE_R][i][band] = (float)orders.r[3];
		rows->row[ROW_DOUBLE_R][i][band] = (float)paper_shape_scale(&shape, SLAB_REFLECTED, modified, &orders);
		rows->row[ROW_DIRECTIONAL_T][i][band] = (float)fmin(1, orders.t[0] + orders.t[1] + orders.t[2]);
		rows->row[ROW_SPHERICAL_R][i][band] = (float)(1 - paper_fit_table_spherical(&rows->fit, tau / rows->fit.extinction_per_m));
	}
}

static void paper_fill_shares(const struct rows *rows, int band)
{
	const double kappa = rows->optics->extinction_per_m[band];
	for (int view = 0; view < SLAB_SLICE_VIEW_COUNT; view++) {
		const double mu = row_cosine(view);
		const struct paper_fit fit = paper_fit_table_at(&rows->fit, acos(mu));
		for (int i = 0; i < COLUMNS; i++) {
			const double tau = row_depth(kappa * rows->thickness_m[i]);
			const double transmittance = paper_transmittance(&fit, tau / rows->fit.extinction_per_m);
			rows->row[SLAB_TABLE_SINGLE + view][i][band] =
				(float)share_of(transmittance, modified_share(rows->optics, band) * tau / mu);
		}
	}
}

/* --- the solved shading --------------------------------------------------------------------------------------------------------- */

/* Scales of double scattering, which only layers of a picture ask for: by successive orders at a few thicknesses, in between linear. */
static void solved_fill_scales(const struct rows *rows)
{
	enum { KNOTS = 15, STEP = COLUMNS / KNOTS };
	double knot[KNOTS + 1][2] = {{0}};
	struct paper_shape shape;
	_Static_assert(KNOTS * STEP == COLUMNS - 1, "knots at columns, the last included");
	paper_shape_init(&shape, rows->optics, 1, 2, rows->mu_l);
	for (int k = 1; k <= KNOTS; k++) {
		const double tau = rows->optics->extinction_per_m[1] * rows->thickness_m[k * STEP];
		const struct slab_orders solved = slab_orders_at(rows->optics, 1, SLAB_PHASE_MODIFIED, tau, rows->mu_l);
		const struct paper_orders orders = {.t = {[2] = solved.t[2]}, .r = {[2] = solved.r[2]}};
		const double modified = modified_share(rows->optics, 1) * tau;
		knot[k][0] = paper_shape_scale(&shape, SLAB_TRANSMITTED, modified, &orders);
		knot[k][1] = paper_shape_scale(&shape, SLAB_REFLECTED, modified, &orders);
	}
	for (int i = 0; i < COLUMNS; i++) {
		const int k = i < COLUMNS - 1 ? i / STEP : KNOTS - 1;
		const double share = (double)(i - k * STEP) / STEP;
		for (int band = 0; band < BAND_COUNT; band++) {
			rows->row[ROW_DOUBLE_T][i][band] = (float)((1 - share) * knot[k][0] + share * knot[k + 1][0]);
			rows->row[ROW_DOUBLE_R][i][band] = (float)((1 - share) * knot[k][1] + share * knot[k + 1][1]);
		}
	}
}

/* Directional here is what went on straight or was turned once; what was turned twice arrives at the ground from so wide a field that it
 * belongs to the diffuse light. */
static void solved_fill_columns(const struct rows *rows, int band)
{
	double tau[COLUMNS];
	struct slab_flux flux[COLUMNS];
	struct paper_shape shape;
	for (int i = 0; i < COLUMNS; i++)
		tau[i] = rows->optics->extinction_per_m[band] * rows->thickness_m[i];
	slab_flux_row(rows->slab, band, rows->mu_l, tau, COLUMNS, flux);
	paper_shape_init(&shape, rows->optics, band, 1, rows->mu_l);
	for (int i = 0; i < COLUMNS; i++) {
		const double modified = modified_share(rows->optics, band) * tau[i];
		const double once = paper_shape_flux(&shape, SLAB_TRANSMITTED, modified);
		const double directional = fmin(exp(-modified / rows->mu_l) + once, flux[i].transmitted);
		rows->row[ROW_DIRECTIONAL_T][i][band] = (float)directional;
		rows->row[ROW_DIFFUSE_T][i][band] = (float)(flux[i].transmitted - directional);
		rows->row[ROW_DIFFUSE_R][i][band] = (float)flux[i].reflected;
		rows->row[ROW_SPHERICAL_R][i][band] = (float)slab_spherical_albedo(rows->slab, band, tau[i]);
	}
}

static void solved_fill_shares(const struct rows *rows, int band)
{
	const double scaled = 1 - rows->slab->band[band].truncated;
	double tau[COLUMNS];
	struct slab_flux flux[COLUMNS];
	for (int i = 0; i < COLUMNS; i++)
		tau[i] = row_depth(rows->optics->extinction_per_m[band] * rows->thickness_m[i]);
	for (int view = 0; view < SLAB_SLICE_VIEW_COUNT; view++) {
		const double mu = row_cosine(view);
		slab_flux_row(rows->slab, band, mu, tau, COLUMNS, flux);
		for (int i = 0; i < COLUMNS; i++)
			rows->row[SLAB_TABLE_SINGLE + view][i][band] = (float)share_of(flux[i].transmitted, scaled * tau[i] / mu);
	}
}

/* ---------------------------------------------------------------------------------------------------------------------------------- */

static bool wants_layers(const struct scene *scene)
{
	return scene->output.layers != 1u << LAYER_COLOR || scene->model.paths != SCENE_PATHS_ALL;
}

static void fill(const struct rows *rows)
{
	for (int band = 0; band < BAND_COUNT; band++) {
		if (rows->scene->model.shading == SHADING_PAPER) {
			paper_fill_columns(rows, band);
			paper_fill_shares(rows, band);
		} else {
			solved_fill_columns(rows, band);
			solved_fill_shares(rows, band);
		}
	}
	if (rows->scene->model.shading == SHADING_SOLVED && wants_layers(rows->scene))
		solved_fill_scales(rows);
}

static void rows_destroy(void *value)
{
	struct texture *texture = value;
	texture_finish(texture);
	free(texture);
}

static struct texture *rows_create(const struct stage_context *context, const struct scene *scene, const struct droplet_tables *tables)
{
	/* A sun below the horizon lights the layer from below; the table is the same by symmetry. */
	struct rows rows = {.scene = scene,
			    .optics = tables->optics,
			    .slab = tables->slab,
			    .mu_l = fmax(0.02, fabs(sin(scene->sun.elevation_deg * M_PI / 180)))};
	struct texture *texture = calloc(1, sizeof *texture);
	rows.row = calloc(SLAB_TABLE_HEIGHT, sizeof *rows.row);
	bool ok = texture && rows.row;
	if (ok && scene->model.shading == SHADING_PAPER)
		ok = droplet_store_get_fit(context->droplets, &scene->dsd, scene->model.optics, &rows.fit, NULL);
	for (int i = 0; i < COLUMNS; i++) {
		const double unit = (double)i / (COLUMNS - 1);
		rows.thickness_m[i] = unit * unit * scene->clouds.thickness_m;
	}
	if (ok) {
		fill(&rows);
		ok = texture_init(texture, COLUMNS, SLAB_TABLE_HEIGHT, TEXTURE_RGBA32F, 0);
	}
	if (ok)
		texture_upload(texture, &rows.row[0][0][0]);
	free(rows.row);
	if (!ok) {
		free(texture);
		texture = NULL;
	}
	return texture;
}

const struct texture *slab_rows_get(struct stage_context *context, const struct scene *scene, const struct droplets *droplets)
{
	struct cache_key key = cache_key_make("slab");
	droplets_key_add(&key, scene);
	const double inputs[] = {scene->model.shading, scene->sun.elevation_deg, scene->clouds.thickness_m, wants_layers(scene)};
	for (size_t i = 0; i < sizeof inputs / sizeof *inputs; i++)
		cache_key_add(&key, inputs[i]);
	struct texture *texture = cache_find(context->cache, &key);
	if (texture)
		return texture;
	context->reused = false;
	texture = rows_create(context, scene, droplets->tables);
	if (!texture || !cache_keep(context->cache, &key, texture, texture_bytes(texture), rows_destroy)) {
		log_error("slab tables: out of memory");
		return NULL;
	}
	return texture;
}
