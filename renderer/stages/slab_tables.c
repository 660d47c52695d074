/* Tables of the paper's slab for one sun elevation. */
#include "renderer/log.h"
#include "renderer/optics/paper_slab.h"
#include "renderer/stages/droplets.h"

#include <math.h>
#include <stdlib.h>

enum { ROW_MULTIPLE_T, ROW_DOUBLE_T, ROW_MULTIPLE_R, ROW_DOUBLE_R, ROW_DIRECTIONAL_T, ROW_SPHERICAL_R };

/* Gauss-Legendre nodes over a hemisphere's cosine; enough for the smooth shape of double scattering. */
enum { NODES = 12 };
static const double node_x[NODES / 2] = {0.1252334085114689, 0.3678314989981802, 0.5873179542866175,
					 0.7699026741943047, 0.9041172563704749, 0.9815606342467192};
static const double node_w[NODES / 2] = {0.2491470458134028, 0.2334925365383548, 0.2031674267230659,
					 0.1600783285433462, 0.1069393259953184, 0.0471753363865118};

struct hemisphere {
	double mu[NODES], weight[NODES];    /* over 0..1 */
	double forward[NODES], back[NODES]; /* P_2 averaged over azimuth, light going on and turning back */
};

static void hemisphere_nodes(struct hemisphere *h)
{
	for (int i = 0; i < NODES; i++) {
		const int k = i < NODES / 2 ? NODES / 2 - 1 - i : i - NODES / 2;
		h->mu[i] = 0.5 + 0.5 * (i < NODES / 2 ? -node_x[k] : node_x[k]);
		h->weight[i] = 0.5 * node_w[k];
	}
}

/* Averages over azimuth by the addition theorem: sum (2l+1) chi_l^2 P_l(mu_l) P_l(+-mu_v). 200 terms are plenty for what is integrated
 * next. */
static void hemisphere_phase2(struct hemisphere *h, const struct optics *optics, int band, double mu_l)
{
	enum { TERMS = 200 };
	const int terms = optics->moment_count < TERMS ? optics->moment_count : TERMS;
	for (int i = 0; i < NODES; i++) {
		double a0 = 1, a1 = mu_l, b0 = 1, b1 = h->mu[i], even = 0, odd = 0;
		for (int l = 0; l < terms; l++) {
			const double chi = optics->moment_modified[band][l];
			*(l % 2 ? &odd : &even) += (2 * l + 1) * chi * chi * a0 * b0;
			const double a2 = ((2 * l + 3) * mu_l * a1 - (l + 1) * a0) / (l + 2);
			const double b2 = ((2 * l + 3) * h->mu[i] * b1 - (l + 1) * b0) / (l + 2);
			a0 = a1, a1 = a2, b0 = b1, b1 = b2;
		}
		h->forward[i] = fmax(0, even + odd);
		h->back[i] = fmax(0, even - odd);
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

/* Flux, as a fraction of the sun's on the slab, of single scattering's shape with P_2. */
static void double_fluxes(const struct hemisphere *h, double tau, double mu_l, double *transmitted, double *reflected)
{
	*transmitted = *reflected = 0;
	for (int i = 0; i < NODES; i++) {
		/* 2 pi mu dmu / (4 pi), over mu_l. */
		const double weight = 0.5 * h->weight[i] * h->mu[i] / mu_l;
		*transmitted += weight * h->forward[i] * single_transmitted(tau, mu_l, h->mu[i]);
		*reflected += weight * h->back[i] * single_reflected(tau, mu_l, h->mu[i]);
	}
}

/* The scale is a ratio of two numbers that vanish with the thickness; far beyond 1 it would only mean that the fit fails there. */
static double double_scale(double wanted, double flux)
{
	return flux > 1e-12 ? fmin(wanted / flux, 4) : 0;
}

static void fill_column(float (*rows)[SLAB_SUN_WIDTH][4], int column, int band, double thickness, const struct optics *optics,
			const struct paper_fit *fit, const struct hemisphere *h, double mu_l)
{
	const double kappa = optics->extinction_per_m[band];
	const double tau_modified = kappa * (1 - optics->forward_peak_fraction[band]) * thickness;
	const double similar = thickness * kappa / PAPER_EXTINCTION_PER_M;
	/* T_ms is similar in kappa H, the orders 1 and 2 in kappa_S H. */
	struct paper_fit similar_fit = *fit;
	similar_fit.kappa_c *= (1 - optics->forward_peak_fraction[band]) * PAPER_EXTINCTION_PER_M / PAPER_MODIFIED_EXTINCTION_PER_M;
	const struct paper_orders orders = paper_orders_at(&similar_fit, similar, tau_modified / mu_l);
	double flux_t, flux_r;
	double_fluxes(h, tau_modified, mu_l, &flux_t, &flux_r);
	rows[ROW_MULTIPLE_T][column][band] = (float)orders.t[3];
	rows[ROW_DOUBLE_T][column][band] = (float)double_scale(orders.t[2], flux_t);
	rows[ROW_MULTIPLE_R][column][band] = (float)orders.r[3];
	rows[ROW_DOUBLE_R][column][band] = (float)double_scale(orders.r[2], flux_r);
	rows[ROW_DIRECTIONAL_T][column][band] = (float)fmin(1, orders.t[0] + orders.t[1] + orders.t[2]);
	rows[ROW_SPHERICAL_R][column][band] = (float)(1 - paper_spherical_transmittance(similar));
}

static bool upload_sun(struct slab_tables *tables, const struct scene *scene, const struct optics *optics)
{
	float(*rows)[SLAB_SUN_WIDTH][4] = calloc(SLAB_SUN_ROWS, sizeof *rows);
	if (!rows)
		return false;
	/* A sun below the horizon lights the layer from below; the table is the same by symmetry. */
	const double mu_l = fmax(0.02, fabs(sin(scene->sun.elevation_deg * M_PI / 180)));
	const struct paper_fit fit = paper_fit_at(acos(mu_l));
	struct hemisphere h;
	hemisphere_nodes(&h);
	for (int band = 0; band < BAND_COUNT; band++) {
		hemisphere_phase2(&h, optics, band, mu_l);
		for (int i = 0; i < SLAB_SUN_WIDTH; i++) {
			const double unit = (double)i / (SLAB_SUN_WIDTH - 1);
			fill_column(rows, i, band, unit * unit * scene->clouds.thickness_m, optics, &fit, &h, mu_l);
		}
	}
	const bool ok = texture_init(&tables->sun, SLAB_SUN_WIDTH, SLAB_SUN_ROWS, TEXTURE_RGBA32F, 0);
	if (ok)
		texture_upload(&tables->sun, &rows[0][0][0]);
	free(rows);
	return ok;
}

static bool upload_view(struct slab_tables *tables)
{
	float texels[SLAB_VIEW_SIZE][SLAB_VIEW_SIZE];
	for (int y = 0; y < SLAB_VIEW_SIZE; y++) {
		const struct paper_fit fit = paper_fit_at(y * (M_PI / 2) / (SLAB_VIEW_SIZE - 1));
		for (int x = 0; x < SLAB_VIEW_SIZE; x++) {
			const double unit = (double)x / (SLAB_VIEW_SIZE - 1);
			texels[y][x] = (float)paper_transmittance(&fit, unit * unit * SLAB_VIEW_THICKNESS_M);
		}
	}
	if (!texture_init(&tables->view, SLAB_VIEW_SIZE, SLAB_VIEW_SIZE, TEXTURE_R32F, 0))
		return false;
	texture_upload(&tables->view, &texels[0][0]);
	return true;
}

static void slab_tables_destroy(void *value)
{
	struct slab_tables *tables = value;
	if (!tables)
		return;
	texture_finish(&tables->view);
	texture_finish(&tables->sun);
	free(tables);
}

static struct slab_tables *slab_tables_create(const struct scene *scene, const struct optics *optics)
{
	struct slab_tables *tables = calloc(1, sizeof *tables);
	if (!tables || !upload_sun(tables, scene, optics) || !upload_view(tables)) {
		log_error("slab tables: out of memory");
		slab_tables_destroy(tables);
		return NULL;
	}
	return tables;
}

const struct slab_tables *slab_tables_get(struct stage_context *context, const struct scene *scene, const struct droplets *droplets)
{
	const struct optics *optics = droplets->optics;
	context->block.extinction[3] = (float)(optics->extinction_per_m[1] / PAPER_EXTINCTION_PER_M);

	struct cache_key key = cache_key_make("slab");
	const double inputs[] = {scene->dsd.n0_per_cm3, scene->dsd.gamma,         scene->dsd.effective_radius_um, scene->model.optics,
				 scene->model.shading,  scene->sun.elevation_deg, scene->clouds.thickness_m};
	for (size_t i = 0; i < sizeof inputs / sizeof *inputs; i++)
		cache_key_add(&key, inputs[i]);
	struct slab_tables *tables = cache_find(context->cache, &key);
	if (!tables) {
		context->reused = false;
		tables = slab_tables_create(scene, optics);
		if (tables && !cache_keep(context->cache, &key, tables, texture_bytes(&tables->sun) + texture_bytes(&tables->view),
					  slab_tables_destroy))
			return NULL;
	}
	return tables;
}
