/* The solved slab against photons, over the whole range of droplets, depths and suns. */
#include "tests/validate/validate.h"

#include "renderer/optics/quadrature.h"

#include <stdlib.h>
#include <string.h>

enum { LAYERS = 64, PER_DROPLETS = 4, VIEWS = 6, AZIMUTHS = 5, DIRECTIONS = SLAB_SIDE_COUNT * VIEWS * AZIMUTHS, ROUNDS = 40 };

/* Scatterings that one layer is worth, some 8 s of a processor: of thick layers it leaves out what came through. */
#define SCATTERINGS_MOST 1e8

#define ERROR_WANTED 0.005

static const double zenith_deg[VIEWS] = {0, 20, 40, 60, 72, 82}, azimuth_deg[AZIMUTHS] = {0, 40, 90, 140, 180};

/* One layer with what photons found so far. */
struct traced {
	const struct solved *solved;
	struct photon_params params;
	double view[VIEWS], azimuth[AZIMUTHS];
	int rounds;
	double scatterings;
	double flux[SLAB_SIDE_COUNT], flux_error[SLAB_SIDE_COUNT];
	double radiance[DIRECTIONS], radiance_error[DIRECTIONS];
};

static void layer_init(struct traced *layer, const struct solved *solved, int number)
{
	*layer = (struct traced){.solved = solved};
	for (int i = 0; i < VIEWS; i++)
		layer->view[i] = cos(zenith_deg[i] * DEGREE);
	for (int i = 0; i < AZIMUTHS; i++)
		layer->azimuth[i] = azimuth_deg[i] * DEGREE;
	layer->params = (struct photon_params){.optics = solved->optics,
					       .band = number % BAND_COUNT,
					       .tau = 0.05 * pow(2000, random_unit()),
					       .mu_l = cos(85 * random_unit() * DEGREE),
					       .threads = 2,
					       .view_count = VIEWS,
					       .azimuth_count = AZIMUTHS,
					       .mu_v = layer->view,
					       .azimuth = layer->azimuth};
}

/* Means of rounds of equal size; errors hold the sums of their squares until the end. */
static void layer_trace(struct traced *layer, uint64_t photons)
{
	struct photon_result result;
	const int n = layer->rounds++;
	layer->params.photons = photons;
	layer->params.seed = (uint64_t)n + 1;
	require(slab_photons_trace(&layer->params, &result), "photons cannot be traced");
	const double flux[] = {result.flux.reflected, result.flux.transmitted};
	const double error[] = {result.flux_error.reflected, result.flux_error.transmitted};
	for (int side = 0; side < SLAB_SIDE_COUNT; side++) {
		layer->flux[side] += (flux[side] - layer->flux[side]) / (n + 1);
		layer->flux_error[side] = hypot(layer->flux_error[side] * n, error[side]) / (n + 1);
	}
	for (int k = 0; k < DIRECTIONS; k++) {
		layer->radiance[k] += (result.radiance[k] - layer->radiance[k]) / (n + 1);
		layer->radiance_error[k] = hypot(layer->radiance_error[k] * n, result.radiance_error[k]) / (n + 1);
	}
	layer->scatterings += (double)result.scatterings;
	photon_result_finish(&result);
}

/* Does it need more rounds? A direction in twenty may be left, which costs a tenth of the photons that all would. */
static bool layer_is_done(const struct traced *layer)
{
	int left = 0;
	for (int k = 0; k < DIRECTIONS; k++)
		left += !(layer->radiance_error[k] <= ERROR_WANTED * layer->radiance[k]);
	return left <= DIRECTIONS / 20 && layer->flux_error[0] <= ERROR_WANTED * layer->flux[0] &&
	       layer->flux_error[1] <= ERROR_WANTED * layer->flux[1];
}

/* Only what photons know to half a percent is judged by them. Returns whether this is. */
static bool judge(struct validation *validation, enum tally_id id, double value, double judge, double error, const char *where)
{
	if (!(error <= ERROR_WANTED * judge))
		return false;
	tally_add(&validation->measured.tally[id], fabs(value - judge) / fmax(3 * error, 0.02 * judge), "%s: %.4g instead of %.4g +- %.1g",
		  where, value, judge, error);
	tally_add(&validation->measured.tally[TALLY_PHOTON_ERROR], error / judge, "%s", where);
	return true;
}

static int layer_judge(struct validation *validation, const struct traced *layer)
{
	const struct photon_params *params = &layer->params;
	const struct solved *solved = layer->solved;
	char what[64], where[128];
	int skipped = 0;
	snprintf(what, sizeof what, "gamma %.3g, re %.3g um, tau %.3g, sun at %.1f", solved->dsd.gamma, solved->dsd.effective_radius_um,
		 params->tau, acos(params->mu_l) / DEGREE);
	const struct slab_flux flux = slab_flux_at(solved->slab, params->band, params->tau, params->mu_l);
	skipped += !judge(validation, TALLY_PHOTON_FLUX, flux.reflected, layer->flux[0], layer->flux_error[0], what);
	skipped += !judge(validation, TALLY_PHOTON_FLUX, flux.transmitted, layer->flux[1], layer->flux_error[1], what);
	for (int k = 0; k < DIRECTIONS; k++) {
		const enum slab_side side = k / (VIEWS * AZIMUTHS);
		const int view = k / AZIMUTHS % VIEWS, azimuth = k % AZIMUTHS;
		/* Within 3 degrees of forward the flux is judged, below. */
		if (scattering_cosine(side, params->mu_l, layer->view[view], layer->azimuth[azimuth]) > cos(3 * DEGREE))
			continue;
		const double value = slab_radiance(solved->slab, solved->optics, params->band, side, params->tau, params->mu_l,
						   layer->view[view], layer->azimuth[azimuth]);
		snprintf(where, sizeof where, "%s, %s at %g deg, %g", what, side ? "transmitted" : "reflected", zenith_deg[view],
			 azimuth_deg[azimuth]);
		skipped += !judge(validation, TALLY_PHOTON_RADIANCE, value, layer->radiance[k], layer->radiance_error[k], where);
	}
	return skipped;
}

/* --- the aureole ----------------------------------------------------------------------------------------------------------------- */

/* Nodes over the cone of 3 degrees about the beam. */
enum { RINGS = 6, SPOKES = 4 };

struct node {
	double weight, mu, azimuth;
};

static void cone_nodes(struct node nodes[RINGS * SPOKES], double zenith)
{
	double x[RINGS], weight[RINGS];
	quadrature_gauss(RINGS, x, weight);
	for (int i = 0; i < RINGS * SPOKES; i++) {
		const int ring = i / SPOKES;
		const double angle = 3 * DEGREE * x[ring] * x[ring]; /* dense in the middle */
		const double turn = (i % SPOKES + 0.5) * M_PI / SPOKES, along = sin(angle) * cos(turn);
		nodes[i] = (struct node){
			.weight = 2 * M_PI * sin(angle) * 6 * DEGREE * x[ring] * weight[ring] / SPOKES,
			.mu = cos(zenith) * cos(angle) - along * sin(zenith),
			.azimuth = atan2(sin(angle) * sin(turn), sin(zenith) * cos(angle) + along * cos(zenith)),
		};
	}
}

static void judge_cone(struct validation *validation, const struct solved *solved, int number)
{
	struct node nodes[RINGS * SPOKES];
	const double tau = 0.1 * pow(100, random_unit()), zenith = 80 * random_unit() * DEGREE;
	double found = 0, wanted = 0, variance = 0;
	struct photon_params params = {
		.optics = solved->optics, .band = number % BAND_COUNT, .tau = tau, .mu_l = cos(zenith), .threads = 2};
	params.photons = (uint64_t)effort_count(validation, tau < 1 ? 20000 : tau < 4 ? 60000 : 150000);
	params.view_count = params.azimuth_count = 1;
	cone_nodes(nodes, zenith);
	for (int i = 0; i < RINGS * SPOKES; i++) {
		struct photon_result result;
		params.mu_v = &nodes[i].mu;
		params.azimuth = &nodes[i].azimuth;
		params.seed = (uint64_t)i;
		require(slab_photons_trace(&params, &result), "photons cannot be traced");
		found += nodes[i].weight * slab_radiance(solved->slab, solved->optics, params.band, SLAB_TRANSMITTED, tau, params.mu_l,
							 nodes[i].mu, nodes[i].azimuth);
		wanted += nodes[i].weight * result.radiance[SLAB_TRANSMITTED];
		variance += pow(nodes[i].weight * result.radiance_error[SLAB_TRANSMITTED], 2);
		photon_result_finish(&result);
	}
	tally_add(&validation->measured.tally[TALLY_PHOTON_FORWARD], fabs(found / wanted - 1),
		  "gamma %.3g, re %.3g um, tau %.3g, sun at %.1f deg, standard error %.2g %%", solved->dsd.gamma,
		  solved->dsd.effective_radius_um, tau, zenith / DEGREE, 100 * sqrt(variance) / wanted);
}

void validate_photons(struct validation *validation)
{
	int skipped = 0;
	const int count = effort_count(validation, LAYERS / PER_DROPLETS);
	for (int i = 0; i < count; i++) {
		struct solved solved = solved_init(validation, i ? droplets_at(i - 1) : PAPER_DROPLETS);
		for (int k = 0; k < PER_DROPLETS; k++) {
			struct traced layer;
			layer_init(&layer, &solved, i + k);
			/* Thick layers cost more and need fewer rounds where light leaves by where it came. */
			do
				layer_trace(&layer, (uint64_t)effort_count(validation, 80000));
			while (!layer_is_done(&layer) && layer.rounds < ROUNDS &&
			       layer.scatterings < validation->effort * SCATTERINGS_MOST);
			skipped += layer_judge(validation, &layer);
		}
		judge_cone(validation, &solved, i);
		solved_finish(&solved);
	}
	const struct tally *tally = validation->measured.tally;
	const long judged = tally[TALLY_PHOTON_FLUX].count + tally[TALLY_PHOTON_RADIANCE].count;
	fprintf(validation->page,
		"- Photons: %d layers of tau 0.05 to 100, sun 0 to 85 degrees from the vertical, views 0 to 82. Only values are judged "
		"that the "
		"photons know to\n"
		"  0.5 %%, which is what the largest standard error says: %ld of %ld. The rest, mostly light that came through thick "
		"layers or "
		"leaves near the\n"
		"  horizon, would take more photons than a run has.\n",
		PER_DROPLETS * count, judged, judged + skipped);
}
