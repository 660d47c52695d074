/* Rows of the slab over thickness for one sun elevation, of either shading. */
#include "renderer/stages/slab_tables.h"

#include "renderer/log.h"
#include "renderer/optics/paper_slab.h"

#include <math.h>
#include <stdlib.h>

enum { ROW_MULTIPLE_T, ROW_DOUBLE_T, ROW_MULTIPLE_R, ROW_DOUBLE_R, ROW_DIRECTIONAL_T, ROW_SPHERICAL_R };

enum { COLUMNS = SLAB_TABLE_WIDTH };

typedef float slab_row[COLUMNS][4];

/* Gauss-Legendre nodes over a hemisphere's cosine; enough for the smooth shape of double scattering. */
enum { NODES = 12 };
static const double node_x[NODES / 2] = {0.1252334085114689, 0.3678314989981802, 0.5873179542866175,
					 0.7699026741943047, 0.9041172563704749, 0.9815606342467192};
static const double node_w[NODES / 2] = {0.2491470458134028, 0.2334925365383548, 0.2031674267230659,
					 0.1600783285433462, 0.1069393259953184, 0.0471753363865118};

struct hemisphere {
	double mu[NODES], weight[NODES]; /* over 0..1 */
	/* P_S [0] and P_2 [1] averaged over azimuth, light going on and turning back. */
	double forward[2][NODES], back[2][NODES];
};

/* A table in work. */
struct rows {
	const struct scene *scene;
	const struct droplet_tables *tables;
	double mu_l;
	double thickness_m[COLUMNS];
	slab_row *row; /* [SLAB_TABLE_HEIGHT] */
};

/* --- fluxes of the first two orders' shapes ------------------------------------------------------------------------------------ */

static void hemisphere_nodes(struct hemisphere *h)
{
	for (int i = 0; i < NODES; i++) {
		const int k = i < NODES / 2 ? NODES / 2 - 1 - i : i - NODES / 2;
		h->mu[i] = 0.5 + 0.5 * (i < NODES / 2 ? -node_x[k] : node_x[k]);
		h->weight[i] = 0.5 * node_w[k];
	}
}

/* Averages over azimuth by the addition theorem: sum (2l+1) chi_l P_l(mu_l) P_l(+-mu_v), of P_S and, with chi_l^2, of P_2. 200 terms are
 * plenty for what is integrated next. */
static void hemisphere_phase(struct hemisphere *h, const struct optics *optics, int band, double mu_l)
{
	enum { TERMS = 200 };
	const int terms = optics->moment_count < TERMS ? optics->moment_count : TERMS;
	for (int i = 0; i < NODES; i++) {
		double a0 = 1, a1 = mu_l, b0 = 1, b1 = h->mu[i], sum[2][2] = {{0}};
		for (int l = 0; l < terms; l++) {
			const double chi = optics->moment_modified[band][l], term = (2 * l + 1) * chi * a0 * b0;
			sum[0][l % 2] += term;
			sum[1][l % 2] += chi * term;
			const double a2 = ((2 * l + 3) * mu_l * a1 - (l + 1) * a0) / (l + 2);
			const double b2 = ((2 * l + 3) * h->mu[i] * b1 - (l + 1) * b0) / (l + 2);
			a0 = a1, a1 = a2, b0 = b1, b1 = b2;
		}
		for (int order = 0; order < 2; order++) {
			h->forward[order][i] = fmax(0, sum[order][0] + sum[order][1]);
			h->back[order][i] = fmax(0, sum[order][0] - sum[order][1]);
		}
	}
}

static double single_reflected(double tau, double mu_l, double mu_v)
{
	return mu_l / (mu_l + mu_v) * -expm1(-tau * (1 / mu_l + 1 / mu_v));
}

static double single_transmitted(double tau, double mu_l, double mu_v)
{
	const double a = 1 / fmax(mu_l, mu_v), x = tau * (1 / fmin(mu_l, mu_v) - a);
	return tau / mu_v * exp(-tau * a) * (x < 1e-6 ? 1 - x / 2 : -expm1(-x) / x);
}

/* Flux, as a fraction of the sun's on the slab, of single scattering's shape with P_S (order 0) or P_2 (1). */
static void shape_fluxes(const struct hemisphere *h, int order, double tau, double mu_l, double *transmitted, double *reflected)
{
	*transmitted = *reflected = 0;
	for (int i = 0; i < NODES; i++) {
		/* 2 pi mu dmu / (4 pi), over mu_l. */
		const double weight = 0.5 * h->weight[i] * h->mu[i] / mu_l;
		*transmitted += weight * h->forward[order][i] * single_transmitted(tau, mu_l, h->mu[i]);
		*reflected += weight * h->back[order][i] * single_reflected(tau, mu_l, h->mu[i]);
	}
}

/* The scale is a ratio of two numbers that vanish with the thickness; far beyond 1 it would only mean that the fit fails there. */
static double double_scale(double wanted, double flux)
{
	return flux > 1e-12 ? fmin(wanted / flux, 4) : 0;
}

/* --- the paper's shading -------------------------------------------------------------------------------------------------------- */

static void paper_fill_columns(const struct rows *rows, int band, const struct hemisphere *h)
{
	const struct optics *optics = rows->tables->optics;
	const double kappa = optics->extinction_per_m[band], kappa_s = kappa * (1 - optics->forward_peak_fraction[band]);
	const double mu_l = rows->mu_l;
	struct paper_fit fit = paper_fit_at(acos(mu_l));
	/* T_ms is similar in kappa H, the orders 1 and 2 in kappa_S H. */
	fit.kappa_c *= kappa_s / kappa * PAPER_EXTINCTION_PER_M / PAPER_MODIFIED_EXTINCTION_PER_M;
	for (int i = 0; i < COLUMNS; i++) {
		const double similar = rows->thickness_m[i] * kappa / PAPER_EXTINCTION_PER_M;
		const double tau_modified = kappa_s * rows->thickness_m[i];
		const struct paper_orders orders = paper_orders_at(&fit, similar, tau_modified / mu_l);
		double flux_t, flux_r;
		shape_fluxes(h, 1, tau_modified, mu_l, &flux_t, &flux_r);
		rows->row[ROW_MULTIPLE_T][i][band] = (float)orders.t[3];
		rows->row[ROW_DOUBLE_T][i][band] = (float)double_scale(orders.t[2], flux_t);
		rows->row[ROW_MULTIPLE_R][i][band] = (float)orders.r[3];
		rows->row[ROW_DOUBLE_R][i][band] = (float)double_scale(orders.r[2], flux_r);
		rows->row[ROW_DIRECTIONAL_T][i][band] = (float)fmin(1, orders.t[0] + orders.t[1] + orders.t[2]);
		rows->row[ROW_SPHERICAL_R][i][band] = (float)(1 - paper_spherical_transmittance(similar));
	}
}

/* Share of diffuse light that goes through, of that which meets droplets. */
static double share_of(double transmittance, double slant_depth)
{
	return fmin(fmax((transmittance - exp(-slant_depth)) / -expm1(-slant_depth), 0), 1);
}

static void paper_fill_shares(const struct rows *rows, int band)
{
	const struct optics *optics = rows->tables->optics;
	const double kappa = optics->extinction_per_m[band], kappa_s = kappa * (1 - optics->forward_peak_fraction[band]);
	for (int view = 0; view < SLAB_SLICE_VIEW_COUNT; view++) {
		const double zenith = slab_slice_zenith(view), mu = fmax(cos(zenith), 0.01);
		const struct paper_fit fit = paper_fit_at(acos(mu));
		for (int i = 0; i < COLUMNS; i++) {
			const double h = fmax(rows->thickness_m[i], 1e-3);
			rows->row[SLAB_TABLE_SINGLE + view][i][band] =
				(float)share_of(paper_transmittance(&fit, h * kappa / PAPER_EXTINCTION_PER_M), kappa_s * h / mu);
		}
	}
}

/* --- the solved shading --------------------------------------------------------------------------------------------------------- */

/* Scales of double scattering, which only layers of a picture ask for: by successive orders at a few thicknesses, in between linear. */
static void solved_fill_scales(const struct rows *rows, const struct hemisphere *h)
{
	enum { KNOTS = 15, STEP = COLUMNS / KNOTS };
	const struct optics *optics = rows->tables->optics;
	double knot[KNOTS + 1][2] = {{0}};
	_Static_assert(KNOTS * STEP == COLUMNS - 1, "knots at columns, the last included");
	for (int k = 1; k <= KNOTS; k++) {
		const double tau = optics->extinction_per_m[1] * rows->thickness_m[k * STEP];
		const struct slab_orders orders = slab_orders_at(optics, 1, SLAB_PHASE_MODIFIED, tau, rows->mu_l);
		double flux_t, flux_r;
		shape_fluxes(h, 1, (1 - optics->forward_peak_fraction[1]) * tau, rows->mu_l, &flux_t, &flux_r);
		knot[k][0] = double_scale(orders.t[2], flux_t);
		knot[k][1] = double_scale(orders.r[2], flux_r);
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
static void solved_fill_columns(const struct rows *rows, int band, const struct hemisphere *h)
{
	const struct optics *optics = rows->tables->optics;
	const double kappa = optics->extinction_per_m[band], kappa_s = kappa * (1 - optics->forward_peak_fraction[band]);
	double tau[COLUMNS];
	struct slab_flux flux[COLUMNS];
	for (int i = 0; i < COLUMNS; i++)
		tau[i] = kappa * rows->thickness_m[i];
	slab_flux_row(rows->tables->slab, band, rows->mu_l, tau, COLUMNS, flux);
	for (int i = 0; i < COLUMNS; i++) {
		double t1, r1;
		shape_fluxes(h, 0, kappa_s * rows->thickness_m[i], rows->mu_l, &t1, &r1);
		const double directional = fmin(exp(-kappa_s * rows->thickness_m[i] / rows->mu_l) + t1, flux[i].transmitted);
		rows->row[ROW_DIRECTIONAL_T][i][band] = (float)directional;
		rows->row[ROW_MULTIPLE_T][i][band] = (float)(flux[i].transmitted - directional);
		rows->row[ROW_MULTIPLE_R][i][band] = (float)fmax(flux[i].reflected - r1, 0);
		rows->row[ROW_SPHERICAL_R][i][band] = (float)slab_spherical_albedo(rows->tables->slab, band, tau[i]);
	}
}

static void solved_fill_shares(const struct rows *rows, int band)
{
	const struct slab_band *slab = &rows->tables->slab->band[band];
	const double kappa = rows->tables->optics->extinction_per_m[band];
	double tau[COLUMNS];
	struct slab_flux flux[COLUMNS];
	for (int i = 0; i < COLUMNS; i++)
		tau[i] = fmax(kappa * rows->thickness_m[i], 1e-6);
	for (int view = 0; view < SLAB_SLICE_VIEW_COUNT; view++) {
		const double mu = fmax(cos(slab_slice_zenith(view)), 0.01);
		slab_flux_row(rows->tables->slab, band, mu, tau, COLUMNS, flux);
		for (int i = 0; i < COLUMNS; i++)
			rows->row[SLAB_TABLE_SINGLE + view][i][band] =
				(float)share_of(flux[i].transmitted, (1 - slab->truncated) * tau[i] / mu);
	}
}

/* ---------------------------------------------------------------------------------------------------------------------------------- */

static bool wants_layers(const struct scene *scene)
{
	return scene->output.layers != 1u << LAYER_COLOR;
}

static void fill(const struct rows *rows)
{
	struct hemisphere h[BAND_COUNT];
	for (int band = 0; band < BAND_COUNT; band++) {
		hemisphere_nodes(&h[band]);
		hemisphere_phase(&h[band], rows->tables->optics, band, rows->mu_l);
		if (rows->scene->model.shading == SHADING_PAPER) {
			paper_fill_columns(rows, band, &h[band]);
			paper_fill_shares(rows, band);
		} else {
			solved_fill_columns(rows, band, &h[band]);
			solved_fill_shares(rows, band);
		}
	}
	if (rows->scene->model.shading == SHADING_SOLVED && wants_layers(rows->scene))
		solved_fill_scales(rows, &h[1]);
}

static void rows_destroy(void *value)
{
	struct texture *texture = value;
	texture_finish(texture);
	free(texture);
}

static struct texture *rows_create(const struct scene *scene, const struct droplet_tables *tables)
{
	/* A sun below the horizon lights the layer from below; the table is the same by symmetry. */
	struct rows rows = {.scene = scene, .tables = tables, .mu_l = fmax(0.02, fabs(sin(scene->sun.elevation_deg * M_PI / 180)))};
	struct texture *texture = calloc(1, sizeof *texture);
	rows.row = calloc(SLAB_TABLE_HEIGHT, sizeof *rows.row);
	bool ok = texture && rows.row;
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
	texture = rows_create(scene, droplets->tables);
	if (!texture || !cache_keep(context->cache, &key, texture, texture_bytes(texture), rows_destroy)) {
		log_error("slab tables: out of memory");
		return NULL;
	}
	return texture;
}
